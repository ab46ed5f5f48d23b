/* SPDX-License-Identifier: GPL-2.0-or-later
   Drives a law of the LAMMPS style along a path of openings, slidings and durations, as its force loops do, from the
   words of its coefficients; called through ctypes. */

#include "cohesive_coeff.h"
#include "cohesive_creep.h"
#include "cohesive_mixed.h"

#include <cstring>
#include <sstream>

static constexpr int COLUMNS = 7;    // normal and shear force, stored, used up, delta_reached, damage, progress

static void central(const cohesive::Law &law, int steps, const double *path, double *row)
{
  double reached = 0.0;
  for (int i = 0; i < steps; i++, path += 3, row += COLUMNS) {
    reached = law.grown(path[0], reached);
    const double values[COLUMNS] = {law.tension(path[0], reached), 0.0,     law.stored(path[0], reached),
                                    law.dissipated(reached),       reached, law.damage(reached), 0.0};
    std::memcpy(row, values, sizeof(values));
  }
}

static void mixed(const cohesive::Law &law, int steps, const double *path, double *row)
{
  cohesive::MixedState state{};
  for (int i = 0; i < steps; i++, path += 3, row += COLUMNS) {
    cohesive::advance(law, state, path[0], path[1]);
    double normal, shear;
    cohesive::forces(law, state, path[0], path[1], normal, shear);
    const double values[COLUMNS] = {normal, shear, cohesive::stored(law, state, path[0], path[1]), state.used,
                                    cohesive::reached(law, state), cohesive::damage(law, state), state.progress};
    std::memcpy(row, values, sizeof(values));
  }
}

static void creeping(const cohesive::Law &law, int steps, const double *path, double *row)
{
  cohesive::CreepState state{};
  for (int i = 0; i < steps; i++, path += 3, row += COLUMNS) {
    const cohesive::CreepStep step(law, path[2]);
    cohesive::advance(law, step, state, path[0]);
    const double seen = cohesive::reached(law, state);
    const double values[COLUMNS] = {cohesive::creep_force(law, step, state), 0.0, cohesive::creep_stored(law, step, state),
                                    state.used, seen, law.damage(seen), 0.0};
    std::memcpy(row, values, sizeof(values));
  }
}

// 0 and rows, or 1 and what is wrong with the words in `told`
extern "C" int follow(const char *words, int steps, const double *path, double *rows, char *told, int room)
{
  std::istringstream line(words);
  std::vector<std::string> split;
  for (std::string word; line >> word;) split.push_back(word);
  cohesive::Law law;
  const std::string wrong = cohesive::read_law(split, law);
  std::snprintf(told, room, "%s", (wrong.empty() ? cohesive::write_law(law) : wrong).c_str());
  if (!wrong.empty()) return 1;
  (law.creeps() ? creeping : law.slides() ? mixed : central)(law, steps, path, rows);
  return 0;
}
