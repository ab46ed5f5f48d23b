/* SPDX-License-Identifier: GPL-2.0-or-later
   LAMMPS command `cohesive/history`: the memory of all bonds as a text table, written and read. */

#ifdef COMMAND_CLASS
// clang-format off
CommandStyle(cohesive/history,CohesiveHistory);
// clang-format on
#else

#ifndef LMP_COHESIVE_HISTORY_H
#define LMP_COHESIVE_HISTORY_H

#include "command.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class CohesiveHistory : public Command {
 public:
  explicit CohesiveHistory(class LAMMPS *lmp) : Command(lmp) {}
  void command(int, char **) override;

 private:
  void write(class BondCohesive &, const std::string &file);
  void read(class BondCohesive &, const std::string &file);
  std::vector<double> rows_of_file(const std::string &file, int columns);
};

}    // namespace LAMMPS_NS

#endif
#endif
