/* SPDX-License-Identifier: GPL-2.0-or-later */

#include "bond_cohesive.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "utils.h"

#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;

// history of one bond: delta_reached, and the undeformed vector from the storing atom to its partner
static constexpr int NHISTORY = 3;
static constexpr const char *HISTORY_NAME = "cohesive_history";

void BondCohesive::List::clear()
{
  for (auto *v : {&first, &second, &type, &atom, &slot, &mirror_atom, &mirror_slot}) v->clear();
  for (auto *v : {&nx, &ny, &length, &k_n, &secant, &limit, &reached}) v->clear();
}

BondCohesive::BondCohesive(LAMMPS *lmp) :
    Bond(lmp), finite(false), history_id("COHESIVE_HISTORY"), history_index(-1), built_calls(-1),
    built_step(-1)
{
  writedata = 1;
  single_extra = 4;
  svector = new double[4];
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
  memory->create(setflag, n + 1, "bond:setflag");
  for (int i = 0; i <= n; i++) setflag[i] = 0;
  law.resize(n + 1);
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

void BondCohesive::read_law(int type, double k_n, double f_max, double delta_max)
{
  if (!(k_n > 0.0) || !std::isfinite(k_n)) error->all(FLERR, "k_n = {:g} N/m must be finite and positive", k_n);
  if (!(f_max > 0.0)) error->all(FLERR, "f_max = {:g} N must be positive (inf: the bond takes no damage)", f_max);
  if (std::isfinite(f_max)) {
    if (!(delta_max > 0.0) || !std::isfinite(delta_max))
      error->all(FLERR, "delta_max = {:g} m must be finite and positive", delta_max);
    if (!(delta_max > f_max / k_n))
      error->all(FLERR, "delta_max = {:g} m must be larger than delta_peak = f_max/k_n = {:g} m: raise delta_max or lower f_max",
                 delta_max, f_max / k_n);
  }
  law[type] = {k_n, f_max, delta_max};
  setflag[type] = 1;
}

// bond_coeff TYPE K_N F_MAX DELTA_MAX; f_max and delta_max may be inf
void BondCohesive::coeff(int narg, char **arg)
{
  if (narg != 4) error->all(FLERR, "bond_coeff of cohesive takes a type, k_n, f_max and delta_max");
  if (!allocated) allocate();
  int low, high;
  utils::bounds(FLERR, arg[0], 1, atom->nbondtypes, low, high, error);
  const auto number = [&](const char *word) {
    return strcmp(word, "inf") == 0 ? INFINITY : utils::numeric(FLERR, word, false, lmp);
  };
  for (int type = low; type <= high; type++) read_law(type, number(arg[1]), number(arg[2]), number(arg[3]));
}

void BondCohesive::init_style()
{
  if (domain->dimension != 2) error->all(FLERR, "bond_style cohesive is for two dimensions: use 'dimension 2'");
  if (!atom->tag_enable || atom->map_style == Atom::MAP_NONE)
    error->all(FLERR, "bond_style cohesive needs an atom map: use 'atom_modify map yes'");
  const std::string name = fmt::format("d2_{}", HISTORY_NAME);
  if (!modify->get_fix_by_id(history_id))
    modify->add_fix(fmt::format("{} all property/atom {} {} writedata no", history_id, name,
                                NHISTORY * atom->bond_per_atom));
  int is_double, columns;
  history_index = atom->find_custom(HISTORY_NAME, is_double, columns);
  if (history_index < 0 || columns < NHISTORY * atom->bond_per_atom)
    error->all(FLERR, "the stored history of bond_style cohesive does not fit {} bonds per atom", atom->bond_per_atom);
  built_calls = -1;
}

double *BondCohesive::history(int i, int slot) const
{
  return atom->darray[history_index][i] + NHISTORY * slot;
}

bool BondCohesive::list_is_old() const
{
  return built_calls != neighbor->ncalls || built_step != neighbor->lastcall;
}

int BondCohesive::find_slot(int i, tagint partner) const
{
  for (int m = 0; m < atom->num_bond[i]; m++)
    if (atom->bond_atom[i][m] == partner) return m;
  return -1;
}

// every bond stored on this rank once; newton_bond off keeps two copies, of which the lower tag's computes
void BondCohesive::build_list()
{
  list.clear();
  const int nlocal = atom->nlocal;
  for (int i = 0; i < nlocal; i++) {
    for (int m = 0; m < atom->num_bond[i]; m++) {
      const int type = atom->bond_type[i][m];
      if (type <= 0 || !setflag[type]) continue;
      const int j = domain->closest_image(i, atom->map(atom->bond_atom[i][m]));
      if (j < 0)
        error->one(FLERR, "bond atoms {} {} missing on rank {}: raise 'comm_modify cutoff'", atom->tag[i],
                   atom->bond_atom[i][m], comm->me);
      if (force->newton_bond || j >= nlocal)
        append(i, m, j, -1, -1);
      else if (atom->tag[i] < atom->tag[j])
        append(i, m, j, j, find_slot(j, atom->tag[i]));
    }
  }
  built_calls = neighbor->ncalls;
  built_step = neighbor->lastcall;
}

void BondCohesive::append(int i, int slot, int j, int mirror_i, int mirror_slot)
{
  double *kept = history(i, slot);
  if (kept[1] == 0.0 && kept[2] == 0.0) {    // first seen: the present state is the unstretched one
    kept[1] = atom->x[j][0] - atom->x[i][0];
    kept[2] = atom->x[j][1] - atom->x[i][1];
    if (mirror_slot >= 0) {
      history(mirror_i, mirror_slot)[1] = -kept[1];
      history(mirror_i, mirror_slot)[2] = -kept[2];
    }
  }
  const double length = std::hypot(kept[1], kept[2]);
  if (length == 0.0) error->one(FLERR, "bond atoms {} {} lie on each other", atom->tag[i], atom->tag[j]);
  const int type = atom->bond_type[i][slot];
  list.first.push_back(i);
  list.second.push_back(j);
  list.nx.push_back(kept[1] / length);
  list.ny.push_back(kept[2] / length);
  list.length.push_back(length);
  list.k_n.push_back(law[type].k_n);
  list.secant.push_back(law[type].secant(kept[0]));
  list.limit.push_back(law[type].limit(kept[0]));
  list.reached.push_back(kept[0]);
  list.type.push_back(type);
  list.atom.push_back(i);
  list.slot.push_back(slot);
  list.mirror_atom.push_back(mirror_i);
  list.mirror_slot.push_back(mirror_slot);
}

// a bond opened farther than ever: rare, so the force loop stays short
void BondCohesive::grow(size_t b, double delta)
{
  const auto &own = law[list.type[b]];
  list.reached[b] = delta;
  list.limit[b] = own.limit(delta);
  list.secant[b] = own.secant(delta);
  history(list.atom[b], list.slot[b])[0] = delta;
  if (list.mirror_slot[b] >= 0) history(list.mirror_atom[b], list.mirror_slot[b])[0] = delta;
}

template <bool FINITE> double BondCohesive::opening(size_t b) const
{
  const double *xi = atom->x[list.first[b]], *xj = atom->x[list.second[b]];
  const double dx = xj[0] - xi[0], dy = xj[1] - xi[1];
  if (FINITE) return std::sqrt(dx * dx + dy * dy) - list.length[b];
  return list.nx[b] * dx + list.ny[b] * dy - list.length[b];
}

template <bool FINITE, bool TALLY> void BondCohesive::forces()
{
  double **x = atom->x, **f = atom->f;
  const int nlocal = atom->nlocal, newton = force->newton_bond;
  const size_t n = list.size();
  const int *first = list.first.data(), *second = list.second.data();
  const double *nx = list.nx.data(), *ny = list.ny.data(), *length = list.length.data(), *k_n = list.k_n.data();
  for (size_t b = 0; b < n; b++) {
    const int i = first[b], j = second[b];
    const double dx = x[j][0] - x[i][0], dy = x[j][1] - x[i][1];
    double ex = nx[b], ey = ny[b], delta;
    if (FINITE) {
      const double distance = std::sqrt(dx * dx + dy * dy);
      ex = dx / distance;
      ey = dy / distance;
      delta = distance - length[b];
    } else {
      delta = ex * dx + ey * dy - length[b];
    }
    if (delta > list.limit[b]) grow(b, delta);
    const double tension = (delta < 0.0 ? k_n[b] : list.secant[b]) * delta;
    const double fx = tension * ex, fy = tension * ey;
    if (newton || i < nlocal) {
      f[i][0] += fx;
      f[i][1] += fy;
    }
    if (newton || j < nlocal) {
      f[j][0] -= fx;
      f[j][1] -= fy;
    }
    if (TALLY)
      ev_tally_xyz(i, j, nlocal, newton, law[list.type[b]].stored(delta, list.reached[b]), fx, fy, 0.0, -dx, -dy, 0.0);
  }
}

void BondCohesive::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  if (list_is_old()) build_list();
  if (finite)
    evflag ? forces<true, true>() : forces<true, false>();
  else
    evflag ? forces<false, true>() : forces<false, false>();
}

void BondCohesive::energies(double &stored, double &dissipated)
{
  stored = dissipated = 0.0;
  for (size_t b = 0; b < list.size(); b++) {
    // a bond shared by two ranks without newton_bond is computed on both
    const double share = (!force->newton_bond && list.second[b] >= atom->nlocal) ? 0.5 : 1.0;
    const auto &own = law[list.type[b]];
    const double delta = finite ? opening<true>(b) : opening<false>(b);
    stored += share * own.stored(delta, list.reached[b]);
    dissipated += share * own.dissipated(list.reached[b]);
  }
}

int BondCohesive::failed()
{
  int count = 0;
  for (size_t b = 0; b < list.size(); b++) {
    if (!force->newton_bond && list.second[b] >= atom->nlocal && atom->tag[list.first[b]] > atom->tag[list.second[b]])
      continue;
    if (list.reached[b] >= law[list.type[b]].delta_max) count++;
  }
  return count;
}

// sum of k_n n⊗n over the bonds of each particle (columns xx, yy, xy), undamaged
void BondCohesive::add_stiffness(double **sum)
{
  if (list_is_old()) build_list();
  for (size_t b = 0; b < list.size(); b++) {
    const double k = list.k_n[b], ex = list.nx[b], ey = list.ny[b];
    for (const int i : {list.first[b], list.second[b]}) {
      if (!force->newton_bond && i >= atom->nlocal) continue;
      sum[i][0] += k * ex * ex;
      sum[i][1] += k * ey * ey;
      sum[i][2] += k * ex * ey;
    }
  }
}

double BondCohesive::equilibrium_distance(int /*type*/)
{
  return 0.0;    // each bond has its own undeformed length
}

// extra values: opening, delta_reached, damage, tension
double BondCohesive::single(int type, double /*rsq*/, int i, int j, double &fforce)
{
  int slot = i < atom->nlocal ? find_slot(i, atom->tag[j]) : -1;
  double sign = 1.0;
  int keeper = i;
  if (slot < 0) {
    keeper = atom->map(atom->tag[j]);
    slot = keeper >= 0 && keeper < atom->nlocal ? find_slot(keeper, atom->tag[i]) : -1;
    sign = -1.0;
  }
  fforce = 0.0;
  for (int k = 0; k < single_extra; k++) svector[k] = 0.0;
  if (slot < 0) return 0.0;
  const double *kept = history(keeper, slot);
  const double dx = sign * (atom->x[j][0] - atom->x[i][0]), dy = sign * (atom->x[j][1] - atom->x[i][1]);
  const double length = std::hypot(kept[1], kept[2]), distance = std::hypot(dx, dy);
  const double delta = finite ? distance - length : (kept[1] * dx + kept[2] * dy) / length - length;
  const auto &own = law[type];
  const double tension = own.tension(delta, kept[0]);
  svector[0] = delta;
  svector[1] = kept[0];
  svector[2] = own.damage(kept[0]);
  svector[3] = tension;
  fforce = distance > 0.0 ? -tension / distance : 0.0;
  return own.stored(delta, kept[0]);
}

void BondCohesive::write_restart_settings(FILE *fp)
{
  const int flag = finite;
  fwrite(&flag, sizeof(int), 1, fp);
}

void BondCohesive::read_restart_settings(FILE *fp)
{
  int flag = 0;
  if (comm->me == 0) utils::sfread(FLERR, &flag, sizeof(int), 1, fp, nullptr, error);
  MPI_Bcast(&flag, 1, MPI_INT, 0, world);
  finite = flag;
}

void BondCohesive::write_restart(FILE *fp)
{
  write_restart_settings(fp);
  for (int type = 1; type <= atom->nbondtypes; type++) {
    const double row[3] = {law[type].k_n, law[type].f_max, law[type].delta_max};
    fwrite(row, sizeof(double), 3, fp);
  }
}

void BondCohesive::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  allocate();
  for (int type = 1; type <= atom->nbondtypes; type++) {
    double row[3];
    if (comm->me == 0) utils::sfread(FLERR, row, sizeof(double), 3, fp, nullptr, error);
    MPI_Bcast(row, 3, MPI_DOUBLE, 0, world);
    read_law(type, row[0], row[1], row[2]);
  }
}

void BondCohesive::write_data(FILE *fp)
{
  for (int type = 1; type <= atom->nbondtypes; type++) {
    const auto &own = law[type];
    utils::print(fp, "{} {:.17g} {:.17g} {:.17g}\n", type, own.k_n, own.f_max, own.delta_max);
  }
}

double BondCohesive::memory_usage()
{
  return Bond::memory_usage() + list.first.capacity() * (7.0 * sizeof(int) + 7.0 * sizeof(double));
}
