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
#include "cohesive_law.h"

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

  // for the loading fix: energies of this rank's bonds, and the stiffness around each particle
  void energies(double &stored, double &dissipated);
  int failed();
  void add_stiffness(double **xx_yy_xy);

 private:
  // what the force loop reads, one entry a bond of this rank
  struct List {
    std::vector<int> first, second;          // local indices, ghosts allowed
    std::vector<double> nx, ny, length;      // reference direction first → second, and length
    std::vector<double> k_n, secant, limit;  // stiffness, slope of unloading, opening where history grows
    std::vector<double> reached;             // history
    std::vector<int> type, atom, slot;       // where the history is kept
    std::vector<int> mirror_atom, mirror_slot;    // newton_bond off: its second copy, or -1
    void clear();
    size_t size() const { return first.size(); }
  } list;

  void allocate();
  void read_law(int type, double k_n, double f_max, double delta_max);
  bool list_is_old() const;
  void build_list();
  void append(int atom, int slot, int partner, int mirror_atom, int mirror_slot);
  int find_slot(int atom, tagint partner) const;
  double *history(int atom, int slot) const;
  void grow(size_t bond, double opening);
  template <bool FINITE, bool TALLY> void forces();
  template <bool FINITE> double opening(size_t bond) const;

  bool finite;
  std::vector<cohesive::LinearSoftening> law;    // by bond type
  std::string history_id;
  int history_index;
  bigint built_calls, built_step;
};

}    // namespace LAMMPS_NS

#endif
#endif
