/* SPDX-License-Identifier: GPL-2.0-or-later
   LAMMPS bond style `cohesive`: bonds that soften and remember. */

#ifdef BOND_CLASS
// clang-format off
BondStyle(cohesive,BondCohesive);
// clang-format on
#else

#ifndef LMP_BOND_COHESIVE_H
#define LMP_BOND_COHESIVE_H

#include "bond.h"
#include "cohesive_creep.h"
#include "cohesive_law.h"
#include "cohesive_mixed.h"

#include <cstdint>
#include <string>
#include <vector>

namespace LAMMPS_NS {

class BondCohesive : public Bond {
 public:
  explicit BondCohesive(class LAMMPS *);
  ~BondCohesive() override;

  void settings(int, char **) override;
  void coeff(int, char **) override;
  void init_style() override;
  void compute(int, int) override;
  double equilibrium_distance(int) override;
  double single(int, double, int, int, double &) override;
  void write_restart(FILE *) override;
  void read_restart(FILE *) override;
  void write_restart_settings(FILE *) override;
  void read_restart_settings(FILE *) override;
  void write_data(FILE *) override;
  double memory_usage() override;
  int pack_forward_comm(int, int *, double *, int, int *) override;
  void unpack_forward_comm(int, int, double *) override;
  int pack_reverse_comm(int, int, double *) override;
  void unpack_reverse_comm(int, int *, double *) override;

  // for the fixes and commands that come with the style
  bool slides() const { return sliding; }
  bool creeps() const;
  void set_time(double physical);                          // until the next init, time is what the caller says
  void energies(double &stored, double &dissipated);       // of this rank's bonds
  void add_stiffness(double **opening, double **turning, double share_of_sliding);
  double *rotation(const char *name) const;                // theta, omega, torque or inertia of the particles
  int columns() const { return nhistory; }
  std::vector<double> rows();    // id1 id2 and the history of every bond, once over all ranks
  bool read_history(tagint first, tagint second, const double *row);    // false where this rank does not keep it
  void forget_lists() { built_calls = -1; }

 private:
  // a bond that never softened: all that the short loop reads, ordered by its first atom
  struct Intact {
    double nx, ny, length;    // reference direction first -> second, and length
    int second;               // three times the local index: where the atom begins in x and f
    std::uint16_t type;       // 0: not intact any more
    std::uint16_t slot;
  };
  struct Head {
    int atom, end;    // its intact bonds end before `end`
  };
  // any other bond
  struct Worn {
    double nx, ny, length;
    int first, second, type;
    int slot, mirror_slot;            // where the history is kept; newton_bond off: its second copy, or -1
    double slope, plastic, limit;     // central bonds: the branch of unloading, and the opening where history grows
  };
  // the bonds whose particles belong to one thread, or, in the last part, to more than one
  struct Part {
    std::vector<Head> head;
    std::vector<Intact> intact;
    std::vector<Worn> worn, slid, crept;
    void clear();
  };
  // what the short loop needs to know of a type
  struct Plain {
    double k_n, peak, k_s, per_f_max, per_f_shear;
  };

  void allocate();
  void set_law(int type, const cohesive::Law &);
  void make_rotation();
  void make_history();
  bool list_is_old() const;
  void build_list();
  void append(Part &, int atom, int slot, int partner, int mirror_slot);
  Worn worn_of(int first, const Intact &) const;
  Part &part_of(int i, int j);
  int find_slot(int atom, tagint partner) const;
  double *history(int atom, int slot) const;
  double *partners(int atom) const;
  int follow_partners(int atom);
  void follow_partners();
  double layout() const;
  void refuse_layout(int atom);
  double elapsed();

  template <bool FINITE> void all_forces();
  template <bool FINITE, bool SLIDING> void forces_of(Part &, bool guarded);
  template <bool FINITE, bool SLIDING, bool GUARDED, bool TALLY> void intact_forces(Part &);
  // of what stands in restart files; another layout, another number. Before 2 there was none
  static constexpr double RESTART_FORMAT = 2.0;

  static void put_in_order(std::vector<Worn> &, size_t ordered);
  template <bool FINITE, bool SLIDING> void leave(Part &, int first, Intact &);
  template <bool FINITE, bool SLIDING, bool GUARDED, bool TALLY> void worn_forces(Part &);

  // kinematics of one bond
  struct Arm {
    double dx, dy, ex, ey, opening, sliding, lever;
  };
  template <bool FINITE, bool SLIDING> Arm arm_of(int i, int j, double nx, double ny, double length) const;
  template <bool GUARDED, bool TALLY>
  void apply(int i, int j, double length, const Arm &, double normal, double shear, double stored);
  double stored_in(const Worn &, const Arm &) const;
  double used_by(const Worn &) const;
  Arm arm_of(const Worn &) const;
  void keep(const Worn &, const double *row);

  bool finite, sliding;
  int nhistory;    // columns of a bond's history
  int restored;    // the same in the restart file, if one was read
  std::vector<cohesive::Law> law;    // by bond type
  std::vector<Plain> plain;
  std::vector<cohesive::CreepStep> step;    // by bond type, of the step at hand
  std::vector<Part> part;                   // one a thread, and one for bonds between threads
  std::vector<std::uint16_t> thread_of;     // by local atom
  std::string history_id;
  int history_index;
  double *theta, *torque;
  bigint built_calls, built_step;
  double time_now, time_seen;
  bool time_given, seen_given;    // whether time is, and was, what set_time says; else that of the simulation
};

}    // namespace LAMMPS_NS

#endif
#endif
