/* SPDX-License-Identifier: GPL-2.0-or-later
   Forces and energies of bond style cohesive.

   Nearly all bonds never soften. They stand in a list of 32 bytes a bond, ordered by their first particle, and go
   through a loop without branches; one that leaves the elastic range moves to a list of its own, with memory. */

#include "bond_cohesive.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "force.h"

#include <algorithm>
#include <cmath>
#include <iterator>

using namespace LAMMPS_NS;

namespace {

// x and y of a particle, read and written as one: halves of different width would stall each other
typedef double Pair2 __attribute__((vector_size(16), aligned(8), may_alias));

inline Pair2 &pair(double *p)
{
  return *reinterpret_cast<Pair2 *>(p);
}
inline const Pair2 &pair(const double *p)
{
  return *reinterpret_cast<const Pair2 *>(p);
}

// how far a bond has turned (tan of it: cross/dot) beyond its ends, nearest to none
__attribute__((noinline, cold)) double turned_far(double cross, double dot, double mean)
{
  const double more = std::atan2(cross, dot) - mean;
  return std::fabs(more) < M_PI ? more : std::remainder(more, 2.0 * M_PI);
}

// the same by a short series, to the last bit for turns up to 0.01
inline double turned(double cross, double dot, double mean)
{
  const double t = cross / dot, q = t * t;
  if (__builtin_expect(!(dot > 0.0 && q < 1e-4 && std::fabs(mean) < 1.0), 0)) return turned_far(cross, dot, mean);
  return t - t * q * (1.0 / 3 - q * (1.0 / 5 - q * (1.0 / 7 - q * (1.0 / 9)))) - mean;
}

inline cohesive::MixedState mixed_state(const double *row)
{
  return {row[0], row[3], row[4], row[5]};
}

inline cohesive::CreepState creep_state(const double *row, int arms)
{
  cohesive::CreepState state{row[0], row[4], row[5], row[3], {}};
  for (int a = 0; a < arms; a++) state.arm[a] = row[6 + a];
  return state;
}

}    // namespace

template <bool FINITE, bool SLIDING>
BondCohesive::Arm BondCohesive::arm_of(int i, int j, double nx, double ny, double length) const
{
  const Pair2 arm = pair(atom->x[j]) - pair(atom->x[i]);
  Arm own{arm[0], arm[1], nx, ny, 0.0, 0.0, 1.0};
  if (FINITE) {
    const double distance = std::sqrt(arm[0] * arm[0] + arm[1] * arm[1]);
    own.ex = arm[0] / distance;
    own.ey = arm[1] / distance;
    own.opening = distance - length;
    own.lever = length / distance;
  } else {
    own.opening = nx * arm[0] + ny * arm[1] - length;
  }
  if (SLIDING) {
    const double cross = nx * arm[1] - ny * arm[0], both = theta[i] + theta[j];
    own.sliding = FINITE ? length * turned(cross, nx * arm[0] + ny * arm[1], 0.5 * both) : cross - 0.5 * length * both;
  }
  return own;
}

BondCohesive::Arm BondCohesive::arm_of(const Worn &b) const
{
  if (sliding)
    return finite ? arm_of<true, true>(b.first, b.second, b.nx, b.ny, b.length)
                  : arm_of<false, true>(b.first, b.second, b.nx, b.ny, b.length);
  return finite ? arm_of<true, false>(b.first, b.second, b.nx, b.ny, b.length)
                : arm_of<false, false>(b.first, b.second, b.nx, b.ny, b.length);
}

// tension pulls the ends together, shear slides the second back and turns both; on ghosts only where allowed
template <bool GUARDED, bool TALLY>
void BondCohesive::apply(int i, int j, double length, const Arm &arm, double normal, double shear, double stored)
{
  double **f = atom->f;
  const double across = shear * arm.lever;
  const double fx = normal * arm.ex - across * arm.ey, fy = normal * arm.ey + across * arm.ex;
  const Pair2 force{fx, fy};
  const bool write_second = !GUARDED || j < atom->nlocal;
  pair(f[i]) += force;
  if (write_second) pair(f[j]) -= force;
  if (torque) {
    torque[i] += 0.5 * length * shear;
    if (write_second) torque[j] += 0.5 * length * shear;
  }
  if (TALLY)
    ev_tally_xyz(i, j, atom->nlocal, this->force->newton_bond, stored, fx, fy, 0.0, -arm.dx, -arm.dy, 0.0);
}

// lists keep the order in which they are built: a run that goes on from a restart adds in the same order, to the bit
void BondCohesive::put_in_order(std::vector<Worn> &list, size_t ordered)
{
  if (list.size() == ordered) return;
  std::inplace_merge(list.begin(), list.begin() + ordered, list.end(), [](const Worn &a, const Worn &b) {
    return a.first != b.first ? a.first < b.first : a.slot < b.slot;
  });
}

// a bond goes where it has a memory; its place stays, without any stiffness
template <bool FINITE, bool SLIDING> void BondCohesive::leave(Part &own, int i, Intact &bond)
{
  (law[bond.type].slides() ? own.slid : own.worn).push_back(worn_of(i, bond));
  bond.type = 0;
}

template <bool FINITE, bool SLIDING, bool GUARDED, bool TALLY> void BondCohesive::intact_forces(Part &own)
{
  if (own.intact.empty()) return;
  const size_t worn = own.worn.size(), slid_before = own.slid.size();
  const double *x = atom->x[0];
  double *f = atom->f[0];
  const Plain *types = plain.data();
  const int nlocal3 = 3 * atom->nlocal;
  Intact *bond = own.intact.data();
  const Intact *first = bond;
  for (const Head head : own.head) {
    const int i = 3 * head.atom;
    const Pair2 here = pair(x + i);
    const double turn = SLIDING ? theta[head.atom] : 0.0;
    Pair2 sum = {0.0, 0.0};
    double torsion = 0.0;
    for (const Intact *end = first + head.end; bond < end; bond++) {
      const int j = bond->second;
      const Plain *type = types + bond->type;
      const Pair2 normal = pair(&bond->nx), arm = pair(x + j) - here, part = normal * arm;
      Pair2 along = normal;
      double opening, lever = 1.0;
      if (FINITE) {
        const Pair2 square = arm * arm;
        const double distance = std::sqrt(square[0] + square[1]), inverse = 1.0 / distance;
        along = arm * inverse;
        opening = distance - bond->length;
        lever = bond->length * inverse;
      } else {
        opening = part[0] + part[1] - bond->length;
      }
      double slid = 0.0, share = opening > type->peak ? 2.0 : 0.0;    // above 1: not elastic any more
      if (SLIDING) {
        const double cross = normal[0] * arm[1] - normal[1] * arm[0], both = turn + theta[j / 3];
        slid = FINITE ? bond->length * turned(cross, part[0] + part[1], 0.5 * both)
                      : cross - 0.5 * bond->length * both;
        const double open = type->per_f_max * std::fmax(opening, 0.0), slide = type->per_f_shear * slid;
        share = open * open + slide * slide;
      }
      if (__builtin_expect(share > 1.0, 0)) {
        leave<FINITE, SLIDING>(own, head.atom, *bond);
        type = types;
      }
      const double tension = type->k_n * opening;
      Pair2 force = along * tension;
      if (SLIDING) {
        const double shear = type->k_s * slid, across = shear * lever, twist = 0.5 * bond->length * shear;
        force += Pair2{-across * along[1], across * along[0]};
        torsion += twist;
        if (!GUARDED || j < nlocal3) torque[j / 3] += twist;
      }
      sum += force;
      if (!GUARDED || j < nlocal3) pair(f + j) -= force;
      if (TALLY) {
        const double stored = 0.5 * (tension * opening + type->k_s * slid * slid);
        ev_tally_xyz(head.atom, j / 3, atom->nlocal, this->force->newton_bond, stored, force[0], force[1], 0.0,
                     -arm[0], -arm[1], 0.0);
      }
    }
    pair(f + i) += sum;
    if (SLIDING) torque[head.atom] += torsion;
  }
  put_in_order(own.worn, worn);
  put_in_order(own.slid, slid_before);
}

template <bool FINITE, bool SLIDING, bool GUARDED, bool TALLY> void BondCohesive::worn_forces(Part &own)
{
  for (auto &b : own.worn) {
    const Arm arm = arm_of<FINITE, false>(b.first, b.second, b.nx, b.ny, b.length);
    const auto &law_of = law[b.type];
    if (arm.opening > b.limit) {
      b.slope = law_of.slope(arm.opening);
      b.plastic = law_of.plastic(arm.opening);
      b.limit = arm.opening;
      double row[3] = {arm.opening, 0.0, 0.0};
      history(b.first, b.slot)[0] = row[0];
      if (b.mirror_slot >= 0) history(b.second, b.mirror_slot)[0] = row[0];
    }
    const double tension =
        std::fmax(b.slope * (arm.opening - b.plastic), 0.0) + law_of.k_n * std::fmin(arm.opening, 0.0);
    apply<GUARDED, TALLY>(b.first, b.second, b.length, arm, tension, 0.0, TALLY ? stored_in(b, arm) : 0.0);
  }
  for (auto &b : own.slid) {
    const Arm arm = arm_of<FINITE, true>(b.first, b.second, b.nx, b.ny, b.length);
    auto state = mixed_state(history(b.first, b.slot));
    cohesive::advance(law[b.type], state, arm.opening, arm.sliding);
    const double row[6] = {state.progress, 0.0, 0.0, state.opening, state.sliding, state.used};
    double *kept = history(b.first, b.slot);
    for (const int k : {0, 3, 4, 5}) kept[k] = row[k];
    if (b.mirror_slot >= 0)
      for (const int k : {0, 3, 4, 5}) history(b.second, b.mirror_slot)[k] = row[k];
    double normal, shear;
    cohesive::forces(law[b.type], state, arm.opening, arm.sliding, normal, shear);
    apply<GUARDED, TALLY>(b.first, b.second, b.length, arm, normal, shear, TALLY ? stored_in(b, arm) : 0.0);
  }
  for (auto &b : own.crept) {
    const Arm arm = arm_of<FINITE, false>(b.first, b.second, b.nx, b.ny, b.length);
    const auto &law_of = law[b.type];
    auto state = creep_state(history(b.first, b.slot), law_of.arms);
    cohesive::advance(law_of, step[b.type], state, arm.opening);
    double row[6 + cohesive::MOST_ARMS] = {state.reached, 0.0, 0.0, state.onset, state.opening, state.used};
    for (int a = 0; a < law_of.arms; a++) row[6 + a] = state.arm[a];
    keep(b, row);
    const double tension = cohesive::creep_force(law_of, step[b.type], state);
    apply<GUARDED, TALLY>(b.first, b.second, b.length, arm, tension, 0.0, TALLY ? stored_in(b, arm) : 0.0);
  }
}

template <bool FINITE, bool SLIDING> void BondCohesive::forces_of(Part &own, bool guarded)
{
  if (evflag) {
    if (guarded) {
      intact_forces<FINITE, SLIDING, true, true>(own);
      worn_forces<FINITE, SLIDING, true, true>(own);
    } else {
      intact_forces<FINITE, SLIDING, false, true>(own);
      worn_forces<FINITE, SLIDING, false, true>(own);
    }
  } else if (guarded) {
    intact_forces<FINITE, SLIDING, true, false>(own);
    worn_forces<FINITE, SLIDING, true, false>(own);
  } else {
    intact_forces<FINITE, SLIDING, false, false>(own);
    worn_forces<FINITE, SLIDING, false, false>(own);
  }
}

// each thread writes to its own particles only; bonds between them come last, in one thread
template <bool FINITE> void BondCohesive::all_forces()
{
  const int threads = static_cast<int>(part.size()) - 1;
  const auto forces = [&](Part &own, bool guarded) {
    sliding ? forces_of<FINITE, true>(own, guarded) : forces_of<FINITE, false>(own, guarded);
  };
  if (threads > 1 && !evflag) {
#ifdef _OPENMP
#pragma omp parallel for num_threads(threads) schedule(static, 1)
#endif
    for (int t = 0; t < threads; t++) forces(part[t], false);
  } else {
    for (int t = 0; t < threads; t++) forces(part[t], false);
  }
  forces(part.back(), !force->newton_bond);
}

void BondCohesive::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  if (list_is_old()) build_list();
  theta = sliding ? rotation("theta") : nullptr;
  torque = sliding ? rotation("torque") : nullptr;
  if (sliding) {
    std::fill(torque, torque + atom->nlocal + atom->nghost, 0.0);
    comm->forward_comm(this);
  }
  if (creeps()) {
    const double duration = elapsed();
    step.clear();
    for (const auto &own : law) step.emplace_back(own, duration);
  }
  finite ? all_forces<true>() : all_forces<false>();
  if (sliding && force->newton_bond) comm->reverse_comm(this);
}

double BondCohesive::stored_in(const Worn &b, const Arm &arm) const
{
  const auto &own = law[b.type];
  const double *row = history(b.first, b.slot);
  if (own.slides()) return cohesive::stored(own, mixed_state(row), arm.opening, arm.sliding);
  if (own.creeps()) return cohesive::creep_stored(own, step[b.type], creep_state(row, own.arms));
  return own.stored(arm.opening, row[0]);
}

double BondCohesive::used_by(const Worn &b) const
{
  const auto &own = law[b.type];
  const double *row = history(b.first, b.slot);
  return own.slides() || own.creeps() ? row[5] : own.dissipated(row[0]);
}

void BondCohesive::energies(double &stored, double &dissipated)
{
  stored = dissipated = 0.0;
  const auto add = [&](const Worn &b) {
    // a bond shared by two ranks without newton_bond is computed on both
    const double share = (!force->newton_bond && b.second >= atom->nlocal) ? 0.5 : 1.0;
    stored += share * stored_in(b, arm_of(b));
    dissipated += share * used_by(b);
  };
  for (const auto &own : part) {
    const Intact *bond = own.intact.data();
    for (const Head head : own.head)
      for (const Intact *end = own.intact.data() + head.end; bond < end; bond++) {
        if (bond->type == 0) continue;
        const int j = bond->second / 3;
        const Arm arm = arm_of({bond->nx, bond->ny, bond->length, head.atom, j, bond->type, 0, 0, 0.0, 0.0, 0.0});
        const double share = (!force->newton_bond && j >= atom->nlocal) ? 0.5 : 1.0;
        const Plain &type = plain[bond->type];
        stored += share * 0.5 * (type.k_n * arm.opening * arm.opening + type.k_s * arm.sliding * arm.sliding);
      }
    for (const auto *list : {&own.worn, &own.slid, &own.crept})
      for (const auto &b : *list) add(b);
  }
}

// around each particle: sum of k_n n⊗n and a share of k_s s⊗s (columns xx, yy, xy); sum of k_s r². In the order in
// which particles keep their bonds, so that a restart finds the same bits
void BondCohesive::add_stiffness(double **opening, double **turning, double share_of_sliding)
{
  if (list_is_old()) build_list();
  for (int i = 0; i < atom->nlocal; i++)
    for (int m = 0; m < atom->num_bond[i]; m++) {
      const int type = atom->bond_type[i][m];
      if (type <= 0 || !setflag[type]) continue;
      const double *row = history(i, m);
      const double length = std::hypot(row[1], row[2]), nx = row[1] / length, ny = row[2] / length;
      const double kn = law[type].k_n, ks = share_of_sliding * law[type].k_s;
      const double twist = law[type].k_s * 0.25 * length * length;
      const auto add = [&](int k) {
        opening[k][0] += kn * nx * nx + ks * ny * ny;
        opening[k][1] += kn * ny * ny + ks * nx * nx;
        opening[k][2] += (kn - ks) * nx * ny;
        turning[k][0] += twist;
      };
      add(i);    // without newton_bond the other end has a copy of its own
      if (force->newton_bond) add(domain->closest_image(i, atom->map(atom->bond_atom[i][m])));
    }
}

double BondCohesive::single(int type, double /*rsq*/, int i, int j, double &fforce)
{
  int keeper = i, partner = j, slot = i < atom->nlocal ? find_slot(i, atom->tag[j]) : -1;
  if (slot < 0) {    // the other end keeps it
    keeper = atom->map(atom->tag[j]);
    slot = keeper >= 0 && keeper < atom->nlocal ? find_slot(keeper, atom->tag[i]) : -1;
    partner = slot >= 0 ? domain->closest_image(keeper, atom->map(atom->tag[i])) : -1;
  }
  fforce = 0.0;
  for (int k = 0; k < single_extra; k++) svector[k] = 0.0;
  if (slot < 0 || partner < 0) return 0.0;
  theta = sliding ? rotation("theta") : nullptr;
  const double *row = history(keeper, slot);
  const double length = std::hypot(row[1], row[2]);
  const auto &own = law[type];
  const Worn bond = {row[1] / length, row[2] / length, length, keeper, partner, type, slot, -1, 0.0, 0.0, 0.0};
  const Arm arm = arm_of(bond);
  double normal, shear = 0.0, seen = row[0], harm = own.damage(row[0]);
  if (own.slides()) {
    const auto state = mixed_state(row);
    cohesive::forces(own, state, arm.opening, arm.sliding, normal, shear);
    seen = cohesive::reached(own, state);
    harm = cohesive::damage(own, state);
  } else if (own.creeps()) {
    const auto state = creep_state(row, own.arms);
    normal = cohesive::creep_force(own, step[type], state);
    seen = cohesive::reached(own, state);
    harm = own.damage(seen);
  } else {
    normal = own.tension(arm.opening, row[0]);
  }
  const double values[] = {arm.opening, seen, harm, normal, arm.sliding, shear, used_by(bond)};
  std::copy(std::begin(values), std::end(values), svector);
  std::copy(row, row + nhistory, svector + std::size(values));
  const double distance = std::hypot(arm.dx, arm.dy);
  fforce = distance > 0.0 ? -normal / distance : 0.0;
  return stored_in(bond, arm);
}
