/* SPDX-License-Identifier: GPL-2.0-or-later
   The words of fix cohesive/drive. */

#include "fix_cohesive_drive.h"

#include "error.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>

using namespace LAMMPS_NS;

// grip WEIGHTS DX DY DRIVE drive|react|guide
void FixCohesiveDrive::parse_grip(char **arg)
{
  Grip grip;
  grip.weights = arg[0];
  grip.dx = utils::numeric(FLERR, arg[1], false, lmp);
  grip.dy = utils::numeric(FLERR, arg[2], false, lmp);
  grip.drive = utils::numeric(FLERR, arg[3], false, lmp);
  grip.reaction = grip.mobility = 0.0;
  if (strcmp(arg[4], "drive") == 0)
    grip.role = DRIVE;
  else if (strcmp(arg[4], "react") == 0)
    grip.role = REACT;
  else if (strcmp(arg[4], "guide") == 0)
    grip.role = GUIDE;
  else
    error->all(FLERR, "role = {} of a grip must be drive, react or guide", arg[4]);
  if (std::fabs(std::hypot(grip.dx, grip.dy) - 1.0) > 1e-9)
    error->all(FLERR, "direction = ({}, {}) of a grip must be a unit vector", arg[1], arg[2]);
  grips.push_back(grip);
}

void FixCohesiveDrive::parse(int narg, char **arg)
{
  int k = 3;
  const auto need = [&](int n) {
    if (k + n >= narg) error->all(FLERR, "fix cohesive/drive: '{}' needs {} more value(s)", arg[k], n);
  };
  const auto number = [&](double &value) {
    need(1);
    value = utils::numeric(FLERR, arg[k + 1], false, lmp);
    k += 2;
  };
  const auto count = [&](const char *of) {
    const int n = utils::inumeric(FLERR, arg[k + 1], false, lmp);
    if (n < 0) error->all(FLERR, "number of {} = {} must be zero or positive", of, n);
    return n;
  };
  if (igroup != 0) error->all(FLERR, "fix cohesive/drive moves all particles: its group must be all, not {}", arg[1]);
  while (k < narg) {
    if (strcmp(arg[k], "grip") == 0) {
      need(5);
      parse_grip(&arg[k + 1]);
      k += 6;
    } else if (strcmp(arg[k], "gauge") == 0) {
      need(1);
      gauge = arg[k + 1];
      k += 2;
    } else if (strcmp(arg[k], "record") == 0) {
      need(1);
      nevery = utils::inumeric(FLERR, arg[k + 1], false, lmp);
      k += 2;
    } else if (strcmp(arg[k], "frames") == 0) {
      need(1);
      const int n = count("frames");
      need(n + 1);
      for (int i = 0; i < n; i++) stations.push_back(utils::numeric(FLERR, arg[k + 2 + i], false, lmp));
      k += n + 2;
    } else if (strcmp(arg[k], "clock") == 0) {
      need(1);
      const int n = count("clock");
      need(2 * n + 1);
      for (int i = 0; i < n; i++) {
        clock_cmod.push_back(utils::numeric(FLERR, arg[k + 2 + 2 * i], false, lmp));
        clock_time.push_back(utils::numeric(FLERR, arg[k + 3 + 2 * i], false, lmp));
      }
      k += 2 * n + 2;
    } else if (strcmp(arg[k], "rate") == 0) {
      need(3);
      first_rate = utils::numeric(FLERR, arg[k + 1], false, lmp);
      lowest_rate = utils::numeric(FLERR, arg[k + 2], false, lmp);
      highest_rate = utils::numeric(FLERR, arg[k + 3], false, lmp);
      k += 4;
    } else if (strcmp(arg[k], "omega") == 0) {
      number(omega);
    } else if (strcmp(arg[k], "lag") == 0) {
      number(lag_wanted);
    } else if (strcmp(arg[k], "cmod") == 0) {
      number(cmod_max);
    } else if (strcmp(arg[k], "load") == 0) {
      number(first_load);
    } else {
      error->all(FLERR, "fix cohesive/drive does not know '{}'", arg[k]);
    }
  }
  if (grips.empty() || gauge.empty()) error->all(FLERR, "fix cohesive/drive needs grips and a gauge");
  if (!(omega > 0.0)) error->all(FLERR, "omega = {:g} must be positive", omega);
  if (!(cmod_max > 0.0)) error->all(FLERR, "cmod = {:g} m must be positive", cmod_max);
  if (!(lag_wanted > 0.0)) error->all(FLERR, "lag = {:g} must be positive", lag_wanted);
  if (!(first_load > 0.0)) error->all(FLERR, "load = {:g} N must be positive", first_load);
  if (!(lowest_rate > 0.0 && lowest_rate <= first_rate && first_rate <= highest_rate))
    error->all(FLERR, "rates {:g} {:g} {:g} must be positive, and the first between lowest and highest", first_rate,
               lowest_rate, highest_rate);
  for (const auto *values : {&clock_cmod, &clock_time})
    if (!values->empty() && (values->size() < 2 || values->front() != 0.0 ||
                             std::adjacent_find(values->begin(), values->end(), std::greater_equal<>()) != values->end()))
      error->all(FLERR, "the openings and times of a clock must be two or more values that increase from 0");
  if (nevery < 1) error->all(FLERR, "record = {} must be positive", nevery);
}
