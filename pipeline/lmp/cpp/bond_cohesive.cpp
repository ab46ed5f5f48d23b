/* SPDX-License-Identifier: GPL-2.0-or-later
   What LAMMPS asks of a bond style: settings, coefficients, lists, output, restart. The forces: bond_cohesive_forces.cpp */

#include "bond_cohesive.h"

#include "cohesive_coeff.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>

using namespace LAMMPS_NS;

static constexpr const char *ROTATION_ID = "COHESIVE_ROTATION";
static constexpr const char *ROTATION[] = {"theta", "omega", "torque", "inertia"};
// of compute bond/local: opening, delta_reached, damage, tension, sliding, shear, energy used up; then the history
static constexpr int NSINGLE = 7, MOST_HISTORY = 6 + cohesive::MOST_ARMS;

void BondCohesive::Part::clear()
{
  head.clear();
  intact.clear();
  for (auto *list : {&worn, &slid, &crept}) list->clear();
}

BondCohesive::BondCohesive(LAMMPS *lmp) :
    Bond(lmp), finite(false), sliding(false), nhistory(3), restored(0), history_id("COHESIVE_HISTORY"), history_index(-1),
    theta(nullptr), torque(nullptr), built_calls(-1), built_step(-1), time_now(0.0), time_seen(NAN), time_given(false), seen_given(false)
{
  writedata = 1;
  comm_forward = comm_reverse = 1;    // of the rotations, where bonds slide
  single_extra = NSINGLE + MOST_HISTORY;
  svector = new double[NSINGLE + MOST_HISTORY];
}

BondCohesive::~BondCohesive()
{
  delete[] svector;
  if (allocated) memory->destroy(setflag);
  if (modify && modify->get_fix_by_id(history_id)) modify->delete_fix(history_id);
}

void BondCohesive::allocate()
{
  allocated = 1;
  const int n = atom->nbondtypes;
  if (n >= std::numeric_limits<std::uint16_t>::max()) error->all(FLERR, "bond_style cohesive takes up to 65534 types");
  memory->create(setflag, n + 1, "bond:setflag");
  for (int i = 0; i <= n; i++) setflag[i] = 0;
  law.resize(n + 1);
  plain.assign(n + 1, {0.0, INFINITY, 0.0, 0.0, 0.0});
}

void BondCohesive::settings(int narg, char **arg)
{
  finite = false;
  if (narg == 0) return;
  if (narg != 2 || strcmp(arg[0], "kinematics") != 0)
    error->all(FLERR, "bond_style cohesive takes 'kinematics small' or 'kinematics finite'");
  if (strcmp(arg[1], "finite") == 0)
    finite = true;
  else if (strcmp(arg[1], "small") != 0)
    error->all(FLERR, "kinematics = {} must be small or finite", arg[1]);
}

void BondCohesive::set_law(int type, const cohesive::Law &own)
{
  law[type] = own;
  const double peak = own.damageable() ? own.delta_peak() : INFINITY;
  plain[type] = {own.k_n, peak, own.k_s, own.damageable() ? own.k_n / own.f_max : 0.0,
                 own.damageable() && own.slides() ? own.k_s / own.f_shear : 0.0};
  setflag[type] = 1;
}

// bond_coeff TYPE K_N F_MAX DELTA_MAX [options]: see cohesive_coeff.h
void BondCohesive::coeff(int narg, char **arg)
{
  if (narg < 1) error->all(FLERR, "bond_coeff of cohesive takes a type, k_n, f_max and delta_max");
  if (!allocated) allocate();
  int low, high;
  utils::bounds(FLERR, arg[0], 1, atom->nbondtypes, low, high, error);
  cohesive::Law own;
  const std::string wrong = cohesive::read_law(std::vector<std::string>(arg + 1, arg + narg), own);
  if (!wrong.empty()) error->all(FLERR, wrong);
  for (int type = low; type <= high; type++) {
    const auto &before = law[type];
    const bool remembers = setflag[type] && (history_index >= 0 || restored) && before.slides() && own.slides();
    if (remembers && before.elastic_unloading != own.elastic_unloading)
      error->all(FLERR, "unloading of bond type {} cannot change between secant and elastic once its bonds remember: a "
                 "bond that slides keeps its damage with the one, its way along the branch with the other", type);
    set_law(type, own);
  }
}

bool BondCohesive::creeps() const
{
  return std::any_of(law.begin(), law.end(), [](const cohesive::Law &own) { return own.creeps(); });
}

void BondCohesive::init_style()
{
  if (domain->dimension != 2) error->all(FLERR, "bond_style cohesive is for two dimensions: use 'dimension 2'");
  if (!atom->tag_enable || atom->map_style == Atom::MAP_NONE)
    error->all(FLERR, "bond_style cohesive needs an atom map: use 'atom_modify map yes'");
  if (update->whichflag == 2 && comm->me == 0)
    error->warning(FLERR, "bond_style cohesive remembers the largest opening of a minimizer's trials");
  sliding = std::any_of(law.begin(), law.end(), [](const cohesive::Law &own) { return own.slides(); });
  make_history();
  step.clear();
  for (const auto &own : law) step.emplace_back(own, 0.0);
  if (sliding) make_rotation();
  time_given = false;    // a fix that gives it says so after this
  built_calls = -1;
}

// rotations live in a fix property/atom, so that they move with their particles and stand in restart files
void BondCohesive::make_rotation()
{
  int is_double, columns;
  if (atom->find_custom("cohesive_theta", is_double, columns) >= 0) return;
  std::string line = fmt::format("{} all property/atom", ROTATION_ID);
  for (const char *name : ROTATION) line += fmt::format(" d_cohesive_{}", name);
  modify->add_fix(line);
}

double *BondCohesive::rotation(const char *name) const
{
  int is_double, columns;
  const int index = atom->find_custom(fmt::format("cohesive_{}", name).c_str(), is_double, columns);
  if (index < 0 || !is_double || columns != 0) error->all(FLERR, "no per-particle d_cohesive_{}", name);
  return atom->dvector[index];
}

bool BondCohesive::list_is_old() const
{
  return built_calls != neighbor->ncalls || built_step != neighbor->lastcall;
}

// every bond stored on this rank once; newton_bond off keeps two copies, of which the lower tag's computes
void BondCohesive::build_list()
{
  const int nlocal = atom->nlocal, threads = std::max(1, comm->nthreads);
  part.resize(threads + 1);
  for (auto &own : part) own.clear();
  follow_partners();
  thread_of.resize(nlocal);
  for (int i = 0; i < nlocal; i++) thread_of[i] = static_cast<std::uint16_t>((bigint) i * threads / nlocal);
  for (int i = 0; i < nlocal; i++) {
    for (int m = 0; m < atom->num_bond[i]; m++) {
      const int type = atom->bond_type[i][m];
      if (type <= 0 || !setflag[type]) continue;
      const int j = domain->closest_image(i, atom->map(atom->bond_atom[i][m]));
      if (j < 0)
        error->one(FLERR, "bond atoms {} {} missing on rank {}: raise 'comm_modify cutoff'", atom->tag[i],
                   atom->bond_atom[i][m], comm->me);
      if (force->newton_bond || j >= nlocal)
        append(part_of(i, j), i, m, j, -1);
      else if (atom->tag[i] < atom->tag[j])
        append(part_of(i, j), i, m, j, find_slot(j, atom->tag[i]));
    }
  }
  built_calls = neighbor->ncalls;
  built_step = neighbor->lastcall;
}

// the part of the thread that owns both particles; ghosts belong to none, unless there is one thread and it may write
BondCohesive::Part &BondCohesive::part_of(int i, int j)
{
  if (j >= atom->nlocal) return part.size() == 2 && force->newton_bond ? part.front() : part.back();
  return thread_of[i] == thread_of[j] ? part[thread_of[i]] : part.back();
}

void BondCohesive::append(Part &own, int i, int slot, int j, int mirror_slot)
{
  double *kept = history(i, slot);
  if (kept[1] == 0.0 && kept[2] == 0.0) {    // first seen: the present state is the unstretched one
    kept[1] = atom->x[j][0] - atom->x[i][0];
    kept[2] = atom->x[j][1] - atom->x[i][1];
    if (mirror_slot >= 0) {
      history(j, mirror_slot)[1] = -kept[1];
      history(j, mirror_slot)[2] = -kept[2];
    }
  }
  const double length = std::hypot(kept[1], kept[2]);
  if (length == 0.0) error->one(FLERR, "bond atoms {} {} lie on each other", atom->tag[i], atom->tag[j]);
  const int type = atom->bond_type[i][slot];
  const Intact bond = {kept[1] / length, kept[2] / length, length, 3 * j, static_cast<std::uint16_t>(type),
                       static_cast<std::uint16_t>(slot)};
  if (law[type].creeps()) {
    own.crept.push_back(worn_of(i, bond));
  } else if (kept[0] > 0.0) {
    (law[type].slides() ? own.slid : own.worn).push_back(worn_of(i, bond));
  } else {
    own.intact.push_back(bond);
    if (own.head.empty() || own.head.back().atom != i) own.head.push_back({i, 0});
    own.head.back().end = static_cast<int>(own.intact.size());
  }
}

// a bond with all that is known of it
BondCohesive::Worn BondCohesive::worn_of(int i, const Intact &bond) const
{
  const int j = bond.second / 3;
  const auto &own = law[bond.type];
  const double reached = own.slides() || own.creeps() ? 0.0 : history(i, bond.slot)[0];
  const int mirror_slot = force->newton_bond || j >= atom->nlocal ? -1 : find_slot(j, atom->tag[i]);
  return {bond.nx, bond.ny, bond.length, i, j, bond.type, bond.slot, mirror_slot, own.slope(reached),
          own.plastic(reached), own.limit(reached)};
}

void BondCohesive::set_time(double physical)
{
  time_given = true;
  time_now = physical;
}

// physical time since the last call; simulation time where no fix says otherwise
double BondCohesive::elapsed()
{
  if (!time_given) time_now = update->atime + (update->ntimestep - update->atimestep) * update->dt;
  // NAN before the first, and where another clock goes on
  const double passed = time_given == seen_given ? time_now - time_seen : NAN;
  time_seen = time_now;
  seen_given = time_given;
  return passed > 0.0 ? passed : 0.0;
}

double BondCohesive::equilibrium_distance(int /*type*/)
{
  return 0.0;    // each bond has its own undeformed length
}

void BondCohesive::write_restart_settings(FILE *fp)
{
  const double settings[] = {RESTART_FORMAT, finite ? 1.0 : 0.0, time_seen, static_cast<double>(nhistory)};
  fwrite(settings, sizeof(double), std::size(settings), fp);
}

void BondCohesive::read_restart_settings(FILE *fp)
{
  double settings[4] = {};
  const auto count = std::size(settings);
  if (comm->me == 0) utils::sfread(FLERR, settings, sizeof(double), count, fp, nullptr, error);
  MPI_Bcast(settings, static_cast<int>(count), MPI_DOUBLE, 0, world);
  if (settings[0] != RESTART_FORMAT)
    error->all(FLERR, "the restart file holds bond_style cohesive in format {:g}, this version reads format {:g}: begin "
               "again, or go on with the version that wrote it", settings[0], RESTART_FORMAT);
  finite = settings[1] > 0.0;
  time_seen = settings[2];
  restored = static_cast<int>(settings[3]);
}

// the coefficients as the words they were given in: what coeff reads is what a restart brings back
void BondCohesive::write_restart(FILE *fp)
{
  write_restart_settings(fp);
  for (int type = 1; type <= atom->nbondtypes; type++) {
    const std::string line = cohesive::write_law(law[type]);
    const int size = static_cast<int>(line.size());
    fwrite(&size, sizeof(int), 1, fp);
    fwrite(line.data(), 1, line.size(), fp);
  }
}

void BondCohesive::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  allocate();
  for (int type = 1; type <= atom->nbondtypes; type++) {
    int size = 0;
    if (comm->me == 0) utils::sfread(FLERR, &size, sizeof(int), 1, fp, nullptr, error);
    MPI_Bcast(&size, 1, MPI_INT, 0, world);
    std::string line(size, ' ');
    if (comm->me == 0) utils::sfread(FLERR, line.data(), 1, size, fp, nullptr, error);
    MPI_Bcast(line.data(), size, MPI_CHAR, 0, world);
    cohesive::Law own;
    const std::string wrong = cohesive::read_law(utils::split_words(line), own);
    if (!wrong.empty()) error->all(FLERR, "restart file: {}", wrong);
    set_law(type, own);
  }
}

void BondCohesive::write_data(FILE *fp)
{
  for (int type = 1; type <= atom->nbondtypes; type++) utils::print(fp, "{} {}\n", type, cohesive::write_law(law[type]));
}

double BondCohesive::memory_usage()
{
  double bytes = Bond::memory_usage() + thread_of.capacity() * sizeof(std::uint16_t);
  for (const auto &own : part) {
    bytes += own.intact.capacity() * sizeof(Intact) + own.head.capacity() * sizeof(Head);
    bytes += (own.worn.capacity() + own.slid.capacity() + own.crept.capacity()) * sizeof(Worn);
  }
  return bytes;
}

int BondCohesive::pack_forward_comm(int n, int *atoms, double *buf, int, int *)
{
  for (int k = 0; k < n; k++) buf[k] = theta[atoms[k]];
  return n;
}

void BondCohesive::unpack_forward_comm(int n, int first, double *buf)
{
  std::copy(buf, buf + n, theta + first);
}

int BondCohesive::pack_reverse_comm(int n, int first, double *buf)
{
  std::copy(torque + first, torque + first + n, buf);
  return n;
}

void BondCohesive::unpack_reverse_comm(int n, int *atoms, double *buf)
{
  for (int k = 0; k < n; k++) torque[atoms[k]] += buf[k];
}
