/* SPDX-License-Identifier: GPL-2.0-or-later
   A step of fix cohesive/drive: masses, damped leapfrog, grips. What it notes, and how fast it goes:
   fix_cohesive_drive_rule.cpp */

#include "fix_cohesive_drive.h"

#include "bond_cohesive.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "neighbor.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>

using namespace LAMMPS_NS;
using namespace FixConst;

// share of the largest stable step at which the masses are set; the rest covers finite kinematics
static constexpr double SAFETY = 0.9;
static constexpr int NVECTOR = 16;
// what sliding and turning of a bond's ends are bounded by: (a + b)² <= SLIDE a² + TURN b²
static constexpr double SLIDE = 1.25, TURN = 5.0;

FixCohesiveDrive::FixCohesiveDrive(LAMMPS *lmp, int narg, char **arg) :
    Fix(lmp, narg, arg), state{}, bond(nullptr), mean_v(nullptr), stiffness(nullptr), turning(nullptr),
    theta(nullptr), omega_z(nullptr), torque(nullptr), inertia(nullptr)
{
  nevery = 20;
  omega = lag_wanted = cmod_max = first_load = first_rate = lowest_rate = highest_rate = 0.0;
  parse(narg, arg);
  vector_flag = 1;
  size_vector = NVECTOR;
  global_freq = 1;
  extvector = 0;
  time_integrate = 1;
  restart_global = 1;
  restart_peratom = 1;
  create_attribute = 1;
  comm_reverse = 4;
  state.rate = first_rate;
  state.frame_due = 1.0;
  state.next_frame = stations.empty() ? INFINITY : stations.front();
  built_calls = built_step = -1;
  FixCohesiveDrive::grow_arrays(atom->nmax);
  atom->add_callback(Atom::GROW);
  atom->add_callback(Atom::RESTART);
  for (int i = 0; i < atom->nlocal; i++) {
    for (int k = 0; k < 2; k++) mean_v[i][k] = atom->v[i][k];
    mean_v[i][2] = 0.0;
  }
}

FixCohesiveDrive::~FixCohesiveDrive()
{
  atom->delete_callback(id, Atom::GROW);
  atom->delete_callback(id, Atom::RESTART);
  memory->destroy(mean_v);
  memory->destroy(stiffness);
  memory->destroy(turning);
}

int FixCohesiveDrive::setmask()
{
  return INITIAL_INTEGRATE | END_OF_STEP;
}

void FixCohesiveDrive::init()
{
  bond = dynamic_cast<BondCohesive *>(force->bond_match("cohesive"));
  if (!bond) error->all(FLERR, "fix cohesive/drive needs bond_style cohesive");
  if (!atom->rmass_flag || !atom->rmass)
    error->all(FLERR, "fix cohesive/drive needs a mass for each particle: use 'fix property/atom rmass'");
  if (bond->creeps()) {
    if (clock_cmod.empty())
      error->all(FLERR, "bonds that creep need the time of the test: give fix cohesive/drive a 'clock'");
    bond->set_time(state.time);
  }
  built_calls = -1;
}

void FixCohesiveDrive::find_rotation()
{
  if (!bond->slides()) return;
  theta = bond->rotation("theta");
  omega_z = bond->rotation("omega");
  torque = bond->rotation("torque");
  inertia = bond->rotation("inertia");
}

double *FixCohesiveDrive::weights(const std::string &name) const
{
  int is_double, columns;
  const int index = atom->find_custom(name.c_str(), is_double, columns);
  if (index < 0 || !is_double || columns != 0)
    error->all(FLERR, "no per-particle weights d_{}: use 'fix property/atom d_{}'", name, name);
  return atom->dvector[index];
}

// fictitious masses: the same highest frequency around every particle, its bound being
// omega² <= 2 max eigenvalue of (sum of k_n n⊗n + SLIDE k_s s⊗s) / m, and of TURN (sum of k_s r²) / I
void FixCohesiveDrive::assign_masses()
{
  memory->destroy(stiffness);
  memory->destroy(turning);
  const int nall = std::max(atom->nlocal + atom->nghost, 1);
  memory->create(stiffness, nall, 3, "cohesive/drive:stiffness");
  memory->create(turning, nall, 1, "cohesive/drive:turning");
  std::fill(stiffness[0], stiffness[0] + 3 * nall, 0.0);
  std::fill(turning[0], turning[0] + nall, 0.0);
  bond->add_stiffness(stiffness, turning, SLIDE);
  if (force->newton_bond) comm->reverse_comm(this);
  const double scale = update->dt * update->dt / (2.0 * SAFETY * SAFETY);
  for (int i = 0; i < atom->nlocal; i++) {
    const double half = 0.5 * (stiffness[i][0] + stiffness[i][1]);
    const double largest = half + std::hypot(0.5 * (stiffness[i][0] - stiffness[i][1]), stiffness[i][2]);
    if (!(largest > 0.0)) error->one(FLERR, "particle {} has no cohesive bond", atom->tag[i]);
    atom->rmass[i] = scale * largest;
    if (bond->slides()) inertia[i] = turning[i][0] > 0.0 ? scale * TURN * turning[i][0] : atom->rmass[i];
  }
}

int FixCohesiveDrive::pack_reverse_comm(int n, int first, double *buf)
{
  int m = 0;
  for (int i = first; i < first + n; i++) {
    for (int k = 0; k < 3; k++) buf[m++] = stiffness[i][k];
    buf[m++] = turning[i][0];
  }
  return m;
}

void FixCohesiveDrive::unpack_reverse_comm(int n, int *atoms, double *buf)
{
  int m = 0;
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < 3; k++) stiffness[atoms[i]][k] += buf[m++];
    turning[atoms[i]][0] += buf[m++];
  }
}

void FixCohesiveDrive::setup(int)
{
  find_rotation();
  assign_masses();
  build_lists();
  if (state.started == 0.0) {
    if (bond->slides())
      for (int i = 0; i < atom->nlocal; i++) mean_v[i][2] = omega_z[i];
    double sum = gauge_sum();
    MPI_Allreduce(&sum, &state.cmod_zero, 1, MPI_DOUBLE, MPI_SUM, world);
    state.peak = first_load;    // the specimen starts at the machine's speed: that energy came from the machine
    double own = kinetic_energy();
    MPI_Allreduce(&own, &state.kinetic, 1, MPI_DOUBLE, MPI_SUM, world);
    state.work = state.lost_before = state.kinetic;
    state.started = 1.0;
  }
  damping_rate = 2.0 * omega;
  mean_rate = omega;
}

bool FixCohesiveDrive::lists_are_old() const
{
  return built_calls != neighbor->ncalls || built_step != neighbor->lastcall;
}

void FixCohesiveDrive::build_lists()
{
  for (auto &grip : grips) {
    const double *weight = weights(grip.weights);
    grip.atom.clear();
    grip.weight.clear();
    double mobility = 0.0;
    for (int i = 0; i < atom->nlocal; i++) {
      if (weight[i] == 0.0) continue;
      grip.atom.push_back(i);
      grip.weight.push_back(weight[i]);
      mobility += weight[i] * weight[i] / atom->rmass[i];
    }
    MPI_Allreduce(&mobility, &grip.mobility, 1, MPI_DOUBLE, MPI_SUM, world);
    if (!(grip.mobility > 0.0)) error->all(FLERR, "no particle has a weight in d_{}", grip.weights);
  }
  const double *weight = weights(gauge);
  for (auto &grip : grips) {
    double sum = 0.0;
    for (size_t k = 0; k < grip.atom.size(); k++)
      sum += weight[grip.atom[k]] * grip.weight[k] * grip.dx / atom->rmass[grip.atom[k]];
    MPI_Allreduce(&sum, &grip.gauge, 1, MPI_DOUBLE, MPI_SUM, world);
  }
  gauge_atom.clear();
  gauge_weight.clear();
  for (int i = 0; i < atom->nlocal; i++) {
    if (weight[i] == 0.0) continue;
    gauge_atom.push_back(i);
    gauge_weight.push_back(weight[i]);
  }
  built_calls = neighbor->ncalls;
  built_step = neighbor->lastcall;
}

double FixCohesiveDrive::gauge_sum() const
{
  double sum = 0.0;
  for (size_t k = 0; k < gauge_atom.size(); k++) sum += gauge_weight[k] * atom->x[gauge_atom[k]][0];
  return sum;
}

// leapfrog with damping towards the running mean of the velocity; returns the energy it took away
double FixCohesiveDrive::advance(double dt)
{
  double **x = atom->x, **v = atom->v, **f = atom->f;
  const double *mass = atom->rmass;
  const double c = damping_rate * dt, keep = 1.0 / (1.0 + c), follow = mean_rate * dt;
  double lost = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    const double push = dt / mass[i];
    double loss = 0.0;
    for (int k = 0; k < 2; k++) {
      const double before = v[i][k], mean = mean_v[i][k];
      const double after = keep * (before + push * f[i][k] + c * mean);
      loss += (after - mean) * (before + after);
      v[i][k] = after;
      x[i][k] += dt * after;
      mean_v[i][k] = mean + follow * (after - mean);
    }
    lost += 0.5 * c * mass[i] * loss;
  }
  return lost;
}

// the same for rotations
double FixCohesiveDrive::advance_rotation(double dt)
{
  const double c = damping_rate * dt, keep = 1.0 / (1.0 + c), follow = mean_rate * dt;
  double lost = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    const double before = omega_z[i], mean = mean_v[i][2];
    const double after = keep * (before + dt / inertia[i] * torque[i] + c * mean);
    lost += 0.5 * c * inertia[i] * (after - mean) * (before + after);
    omega_z[i] = after;
    theta[i] += dt * after;
    mean_v[i][2] = mean + follow * (after - mean);
  }
  return lost;
}

// physical time: when the gauge of the test was as wide open as it ever was here
void FixCohesiveDrive::read_clock(double widest)
{
  if (!(widest > state.widest)) return;
  state.widest = widest;
  const auto after = std::lower_bound(clock_cmod.begin() + 1, clock_cmod.end() - 1, widest);
  const size_t k = after - clock_cmod.begin();
  const double rate = (clock_time[k] - clock_time[k - 1]) / (clock_cmod[k] - clock_cmod[k - 1]);
  state.time = clock_time[k - 1] + rate * (widest - clock_cmod[k - 1]);
  bond->set_time(state.time);
}

void FixCohesiveDrive::initial_integrate(int)
{
  find_rotation();
  if (lists_are_old()) build_lists();
  const double dt = update->dt;
  state.window.steps += 1.0;
  state.window.gauge += gauge_sum();
  state.window.load_line += state.load_line;

  // what the gripped particles were before the step
  std::vector<double> before;
  for (const auto &grip : grips)
    for (const int i : grip.atom)
      for (int k = 0; k < 2; k++) {
        before.push_back(atom->v[i][k]);
        before.push_back(mean_v[i][k]);
      }
  double lost = advance(dt);
  if (bond->slides()) lost += advance_rotation(dt);

  // one reaction a grip, from the mean velocity that is missing
  const bool timed = bond->creeps();
  std::vector<double> local(grips.size() + 1), missing(grips.size() + 1);
  for (size_t g = 0; g < grips.size(); g++) {
    const auto &grip = grips[g];
    for (size_t k = 0; k < grip.atom.size(); k++) {
      const double *v = atom->v[grip.atom[k]];
      local[g] += grip.weight[k] * (grip.dx * v[0] + grip.dy * v[1]);
    }
  }
  if (timed) local.back() = gauge_sum();
  MPI_Allreduce(local.data(), missing.data(), static_cast<int>(local.size()), MPI_DOUBLE, MPI_SUM, world);
  double cmod = missing.back() - state.cmod_zero;

  const double c = damping_rate * dt, follow = mean_rate * dt;
  size_t at = 0;
  double drive = 0.0, react = 0.0;
  for (size_t g = 0; g < grips.size(); g++) {
    auto &grip = grips[g];
    const double impulse = (grip.drive * state.rate - missing[g]) / grip.mobility;
    grip.reaction = impulse * (1.0 + c) / dt;
    cmod += dt * impulse * grip.gauge;
    for (size_t k = 0; k < grip.atom.size(); k++) {
      const int i = grip.atom[k];
      const double direction[2] = {grip.dx, grip.dy};
      for (int d = 0; d < 2; d++) {
        const double was = before[at++], mean = before[at++], now = atom->v[i][d];
        const double change = impulse * grip.weight[k] * direction[d] / atom->rmass[i];
        atom->v[i][d] += change;
        atom->x[i][d] += dt * change;
        mean_v[i][d] += follow * change;
        lost += 0.5 * c * atom->rmass[i] *
            ((now + change - mean) * (was + now + change) - (now - mean) * (was + now));
      }
    }
    if (grip.role == DRIVE) drive += grip.reaction;
    if (grip.role == REACT) react += grip.reaction;
    state.work += grip.reaction * grip.drive * state.rate * dt;
  }
  state.window.drive += drive;
  state.window.react += react;
  state.load_line += state.rate * dt;
  state.damping_now += lost;
  if (timed) read_clock(cmod);
}
