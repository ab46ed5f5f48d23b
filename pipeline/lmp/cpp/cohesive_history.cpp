/* SPDX-License-Identifier: GPL-2.0-or-later */

#include "cohesive_history.h"

#include "bond_cohesive.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "force.h"
#include "lammps.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

using namespace LAMMPS_NS;

// cohesive/history write FILE, cohesive/history read FILE
void CohesiveHistory::command(int narg, char **arg)
{
  if (narg != 2) error->all(FLERR, "cohesive/history takes 'write FILE' or 'read FILE'");
  auto *bond = dynamic_cast<BondCohesive *>(force->bond_match("cohesive"));
  if (!bond) error->all(FLERR, "cohesive/history needs bond_style cohesive");
  lmp->init();    // the memory is where the style puts it at its first start
  if (strcmp(arg[0], "write") == 0)
    write(*bond, arg[1]);
  else if (strcmp(arg[0], "read") == 0)
    read(*bond, arg[1]);
  else
    error->all(FLERR, "cohesive/history takes 'write FILE' or 'read FILE', not '{}'", arg[0]);
}

// a local dump: ITEM lines, then id1 id2 and the history, once a bond, 17 digits
void CohesiveHistory::write(BondCohesive &bond, const std::string &file)
{
  const std::vector<double> own = bond.rows();
  const int width = 2 + bond.columns();
  int count = static_cast<int>(own.size()), total = 0;
  std::vector<int> counts(comm->nprocs), starts(comm->nprocs);
  MPI_Gather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, 0, world);
  for (int p = 0; p < comm->nprocs; p++) {
    starts[p] = total;
    total += counts[p];
  }
  std::vector<double> rows(comm->me == 0 ? total : 0);
  MPI_Gatherv(own.data(), count, MPI_DOUBLE, rows.data(), counts.data(), starts.data(), MPI_DOUBLE, 0, world);
  if (comm->me != 0) return;
  FILE *fp = fopen(file.c_str(), "w");
  if (!fp) error->one(FLERR, "cannot write {}: {}", file, utils::getsyserror());
  utils::print(fp, "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ENTRIES\n{}\nITEM: ENTRIES id1 id2", update->ntimestep,
               total / width);
  for (int k = 1; k <= bond.columns(); k++) utils::print(fp, " h{}", k);
  fputs("\n", fp);
  for (int r = 0; r < total; r += width) {
    utils::print(fp, "{:.0f} {:.0f}", rows[r], rows[r + 1]);
    for (int k = 2; k < width; k++) utils::print(fp, " {:.17g}", rows[r + k]);
    fputs("\n", fp);
  }
  if (fclose(fp) != 0) error->one(FLERR, "cannot write {}: {}", file, utils::getsyserror());
}

// the numbers behind the last ITEM line, on every rank
std::vector<double> CohesiveHistory::rows_of_file(const std::string &file, int columns)
{
  std::vector<double> values;
  std::string wrong;
  if (comm->me == 0) {
    std::ifstream in(file);
    if (!in) wrong = "cannot read " + file;
    int number = 0;
    bool entries = false;
    for (std::string line; wrong.empty() && std::getline(in, line);) {
      number++;
      if (line.rfind("ITEM:", 0) == 0) {
        entries = line.rfind("ITEM: ENTRIES", 0) == 0;
        if (entries) values.clear();
        continue;
      }
      if (!entries || line.empty()) continue;
      std::istringstream words(line);
      int found = 0;
      for (std::string word; words >> word; found++) {
        char *end = nullptr;
        values.push_back(std::strtod(word.c_str(), &end));
        if (*end != '\0' || !std::isfinite(values.back())) wrong = fmt::format("{} line {}: {} is not a number", file, number, word);
      }
      const auto whole = [&](double id) { return id == std::floor(id) && std::fabs(id) < MAXTAGINT; };
      const auto row = values.end() - std::min<std::ptrdiff_t>(found, values.size());
      if (wrong.empty() && found == columns && !(whole(row[0]) && whole(row[1])))
        wrong = fmt::format("{} line {}: {:g} {:g} are not the ids of two atoms", file, number, row[0], row[1]);
      if (wrong.empty() && found != columns)
        wrong = fmt::format("{} line {} holds {} values, expected {}: id1 id2 and {} of history", file, number, found,
                            columns, columns - 2);
    }
  }
  int told = static_cast<int>(wrong.size());
  MPI_Bcast(&told, 1, MPI_INT, 0, world);
  wrong.resize(told);
  MPI_Bcast(wrong.data(), told, MPI_CHAR, 0, world);
  if (told) error->all(FLERR, wrong);
  int size = static_cast<int>(values.size());
  MPI_Bcast(&size, 1, MPI_INT, 0, world);
  values.resize(size);
  MPI_Bcast(values.data(), size, MPI_DOUBLE, 0, world);
  return values;
}

void CohesiveHistory::read(BondCohesive &bond, const std::string &file)
{
  const int width = 2 + bond.columns();
  const std::vector<double> rows = rows_of_file(file, width);
  const auto ends = [&](size_t r) {
    return std::pair(static_cast<tagint>(rows[r * width]), static_cast<tagint>(rows[r * width + 1]));
  };
  std::vector<int> own(rows.size() / width), all(own.size());
  for (size_t r = 0; r < own.size(); r++)
    own[r] = bond.read_history(ends(r).first, ends(r).second, &rows[r * width + 2]);
  MPI_Allreduce(own.data(), all.data(), static_cast<int>(own.size()), MPI_INT, MPI_MAX, world);
  const size_t unknown = std::find(all.begin(), all.end(), 0) - all.begin();
  if (unknown < all.size())
    error->all(FLERR, "{}: there is no cohesive bond between atoms {} and {}", file, ends(unknown).first,
               ends(unknown).second);
  if (comm->me == 0) utils::logmesg(lmp, "Read the history of {} bonds from {}\n", rows.size() / width, file);
}
