/* SPDX-License-Identifier: GPL-2.0-or-later
   LAMMPS fix `cohesive/nve`: velocity Verlet for particles that bonds of style cohesive move and turn. */

#ifdef FIX_CLASS
// clang-format off
FixStyle(cohesive/nve,FixCohesiveNVE);
// clang-format on
#else

#ifndef LMP_FIX_COHESIVE_NVE_H
#define LMP_FIX_COHESIVE_NVE_H

#include "fix.h"

namespace LAMMPS_NS {

class FixCohesiveNVE : public Fix {
 public:
  FixCohesiveNVE(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup(int) override;
  void initial_integrate(int) override;
  void final_integrate() override;
  double compute_scalar() override;

 private:
  template <bool MOVE> void advance();
  double mass_of(int) const;

  class BondCohesive *bond;
  double radius;
};

}    // namespace LAMMPS_NS

#endif
#endif
