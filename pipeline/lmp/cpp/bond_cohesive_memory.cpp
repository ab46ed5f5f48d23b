/* SPDX-License-Identifier: GPL-2.0-or-later
   Where bond style cohesive keeps the history of its bonds: with the atom that has the bond, by slot. */

#include "bond_cohesive.h"

#include "atom.h"
#include "error.h"
#include "force.h"
#include "modify.h"

#include <algorithm>

using namespace LAMMPS_NS;

static constexpr const char *HISTORY_NAME = "cohesive_history";

void BondCohesive::make_history()
{
  nhistory = sliding ? 6 : 3;
  for (const auto &own : law)
    if (own.creeps()) nhistory = std::max(nhistory, 6 + own.arms);
  if (restored && restored != nhistory)
    error->all(FLERR, "the restart file holds {} values a bond, these bond_coeff need {}: give them the options of the run "
               "that wrote it", restored, nhistory);
  const int wanted = 1 + (nhistory + 1) * atom->bond_per_atom;
  if (!modify->get_fix_by_id(history_id))
    modify->add_fix(fmt::format("{} all property/atom d2_{} {} writedata no", history_id, HISTORY_NAME, wanted));
  int is_double, columns;
  history_index = atom->find_custom(HISTORY_NAME, is_double, columns);
  if (history_index < 0 || columns != wanted)
    error->all(FLERR, "the stored history of bond_style cohesive does not fit {} values for {} bonds per atom: give "
               "every bond_coeff, with its options, before the first run", nhistory, atom->bond_per_atom);
}

// an atom's first value says what the others are: a restart file may hold others
double BondCohesive::layout() const
{
  return 1e6 * RESTART_FORMAT + 1e3 * nhistory + atom->bond_per_atom;
}

void BondCohesive::refuse_layout(int i)
{
  const double *kept = atom->darray[history_index][i], *end = kept + 1 + (nhistory + 1) * atom->bond_per_atom;
  if (kept[0] == layout()) return;
  if (std::any_of(kept, end, [](double value) { return value != 0.0; }))
    error->one(FLERR, "atom {} brings a history of layout {:.0f}, here it is {:.0f} (format, values a bond, bonds an atom: "
               "millions, thousands, ones): give bond_coeff the options of the run that wrote the restart file, or begin "
               "again", atom->tag[i], kept[0], layout());
  atom->darray[history_index][i][0] = layout();
}

double *BondCohesive::history(int i, int slot) const
{
  return atom->darray[history_index][i] + 1 + nhistory * slot;
}

// behind the history of an atom's bonds: with whom they are
double *BondCohesive::partners(int i) const
{
  return history(i, atom->bond_per_atom);
}

// a bond's memory goes with it to the slot where delete_bonds and the like put it; how many are of bonds that are gone
int BondCohesive::follow_partners(int i)
{
  refuse_layout(i);
  const int slots = atom->bond_per_atom, own = atom->num_bond[i];
  double *partner = partners(i);
  const auto with = [&](int m) { return m < own ? static_cast<double>(atom->bond_atom[i][m]) : 0.0; };
  bool same = true;
  for (int m = 0; m < slots; m++) same = same && partner[m] == with(m);
  if (same) return 0;
  std::vector<double> before(history(i, 0), partner + slots);
  const double *was = before.data() + nhistory * slots;
  int lost = slots - static_cast<int>(std::count(was, was + slots, 0.0));
  std::fill(history(i, 0), partner, 0.0);
  for (int m = 0; m < slots; m++) {
    partner[m] = with(m);
    const auto k = std::find(was, was + slots, partner[m]) - was;
    if (m >= own || k == slots) continue;    // a new bond begins at rest
    std::copy_n(before.data() + nhistory * k, nhistory, history(i, m));
    lost--;
  }
  return lost;
}

void BondCohesive::follow_partners()
{
  int lost = 0;
  for (int i = 0; i < atom->nlocal; i++) lost += follow_partners(i);
  if (lost > 0)
    error->warning(FLERR, "bond_style cohesive forgets {} bonds that are gone, or whose atoms were renumbered", lost);
}

int BondCohesive::find_slot(int i, tagint partner) const
{
  for (int m = 0; m < atom->num_bond[i]; m++)
    if (atom->bond_atom[i][m] == partner) return m;
  return -1;
}

// a bond's row, from state to store; the undeformed vector stays
void BondCohesive::keep(const Worn &bond, const double *row)
{
  const auto write = [&](double *kept) {
    kept[0] = row[0];
    for (int k = 3; k < nhistory; k++) kept[k] = row[k];
  };
  write(history(bond.first, bond.slot));
  if (bond.mirror_slot >= 0) write(history(bond.second, bond.mirror_slot));
}

std::vector<double> BondCohesive::rows()
{
  follow_partners();
  std::vector<double> table;
  for (int i = 0; i < atom->nlocal; i++)
    for (int m = 0; m < atom->num_bond[i]; m++) {
      const int type = atom->bond_type[i][m];
      const tagint own = atom->tag[i], other = atom->bond_atom[i][m];
      if (type <= 0 || !setflag[type] || (!force->newton_bond && own > other)) continue;
      table.push_back(static_cast<double>(own));
      table.push_back(static_cast<double>(other));
      table.insert(table.end(), history(i, m), history(i, m) + nhistory);
    }
  return table;
}

bool BondCohesive::read_history(tagint first, tagint second, const double *row)
{
  if (std::min(first, second) < 1 || std::max(first, second) > atom->map_tag_max) return false;
  bool found = false;
  for (const bool turned : {false, true}) {
    const int i = atom->map(turned ? second : first);
    if (i < 0 || i >= atom->nlocal) continue;
    const int slot = find_slot(i, turned ? first : second);
    if (slot < 0) continue;
    follow_partners(i);
    double *kept = history(i, slot);
    for (int k = 0; k < nhistory; k++) kept[k] = (turned && (k == 1 || k == 2)) ? -row[k] : row[k];
    found = true;
  }
  forget_lists();
  return found;
}
