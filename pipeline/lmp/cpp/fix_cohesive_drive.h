/* SPDX-License-Identifier: GPL-2.0-or-later
   LAMMPS fix `cohesive/drive`: opens a specimen slowly enough to stay near equilibrium. */

#ifdef FIX_CLASS
// clang-format off
FixStyle(cohesive/drive,FixCohesiveDrive);
// clang-format on
#else

#ifndef LMP_FIX_COHESIVE_DRIVE_H
#define LMP_FIX_COHESIVE_DRIVE_H

#include "fix.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixCohesiveDrive : public Fix {
 public:
  FixCohesiveDrive(class LAMMPS *, int, char **);
  ~FixCohesiveDrive() override;

  int setmask() override;
  void init() override;
  void setup(int) override;
  void initial_integrate(int) override;
  void end_of_step() override;
  double compute_vector(int) override;
  double memory_usage() override;

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  int pack_restart(int, double *) override;
  void unpack_restart(int, int) override;
  int size_restart(int) override;
  int maxsize_restart() override;
  void write_restart(FILE *) override;
  void restart(char *) override;
  int pack_reverse_comm(int, int, double *) override;
  void unpack_reverse_comm(int, int *, double *) override;

 private:
  static constexpr int NMEAN = 3;    // per-particle means kept: velocity x and y, rotation

  enum Role { DRIVE, REACT, GUIDE };

  // one prescribed mean velocity: sum of weight × direction·v = drive × rate
  struct Grip {
    std::string weights;
    double dx, dy, drive;
    Role role;
    std::vector<int> atom;
    std::vector<double> weight;
    double mobility;    // sum of weight² / mass, all ranks
    double gauge;       // what a unit impulse adds to the speed of the gauge
    double reaction;
  };

  // sums over the steps since the last record; of the gauge those of this rank
  struct Window {
    double steps, drive, react, load_line, gauge;
  };

  // everything that a restart has to bring back: doubles only
  struct State {
    double load_line, rate, cmod_zero, started;
    double work, damping, lost_before;
    double peak, lag;
    double excess, error_sum, load_sum, opened;    // N; N² m over CMOD: of the excess, of the load; largest CMOD, m
    double cmod, load, load_line_mean, load_drive, load_react, stored, dissipated, kinetic;
    double next_frame, frame_due;
    double widest, time;    // largest CMOD, and the time at which the test was there
    Window window;
    double damping_now;     // of the steps since the last record, on this rank
  } state;

  void parse(int, char **);
  void parse_grip(char **);
  double *weights(const std::string &) const;
  void assign_masses();
  void build_lists();
  void read_clock(double widest);
  bool lists_are_old() const;
  double gauge_sum() const;
  double advance(double dt);
  double advance_rotation(double dt);
  void find_rotation();
  void record();
  void measure_lag();
  double lag_allowed() const;
  void choose_rate();
  void mark_frames();
  double kinetic_energy() const;

  class BondCohesive *bond;
  std::vector<Grip> grips;
  std::string gauge;
  std::vector<int> gauge_atom;
  std::vector<double> gauge_weight;

  double omega, lag_wanted, cmod_max, first_load, first_rate, lowest_rate, highest_rate;
  double damping_rate, mean_rate;
  std::vector<double> stations;
  std::vector<double> clock_cmod, clock_time;    // t(CMOD) of the test, for bonds that creep
  double **mean_v;                               // running mean of the velocity: x, y, and of the rotation
  double **stiffness, **turning;                 // scratch of assign_masses
  double *theta, *omega_z, *torque, *inertia;    // rotations of the particles, or null
  bigint built_calls, built_step;
};

}    // namespace LAMMPS_NS

#endif
#endif
