#include "plan.hpp"

#include <algorithm>
#include <stdexcept>

namespace cholesky {
namespace {

using Rows = std::vector<int32_t>;

struct Pattern {
  int32_t size;
  const int32_t *start, *row;
};

// Columns that are eliminated together, and how many entries theirs have in the factor.
struct Group {
  int32_t first, last;
  double entries;
};

// Parent of every column in the elimination tree (Liu 1986), −1 of roots.
Rows elimination_tree(const Pattern &pattern) {
  Rows parent(pattern.size, -1), ancestor(pattern.size, -1);
  for (int32_t j = 0; j < pattern.size; ++j)
    for (int32_t k = pattern.start[j]; k < pattern.start[j + 1]; ++k)
      for (int32_t i = pattern.row[k]; i != -1 && i < j;) {
        const int32_t next = ancestor[i];
        ancestor[i] = j;  // shortens the next climb
        if (next == -1) parent[i] = j;
        i = next;
      }
  return parent;
}

// Rows below the diagonal of every column of the factor: its own and those of its children, in no order.
std::vector<Rows> structures(const Pattern &pattern, const Rows &parent) {
  std::vector<Rows> below(pattern.size), children(pattern.size);
  Rows seen(pattern.size, -1);
  for (int32_t j = 0; j < pattern.size; ++j) {
    const auto take = [&](int32_t i) {
      if (i <= j || seen[i] == j) return;
      seen[i] = j;
      below[j].push_back(i);
    };
    std::for_each(pattern.row + pattern.start[j], pattern.row + pattern.start[j + 1], take);
    for (const int32_t child : children[j]) std::for_each(below[child].begin(), below[child].end(), take);
    if (parent[j] >= 0) children[parent[j]].push_back(j);
  }
  return below;
}

// Whether storing zeros, as a share of a front of so many columns, is worth the fewer fronts
// (the thresholds of CHOLMOD: Chen, Davis, Hager & Rajamanickam 2008).
bool worth(int32_t columns, double zeros) {
  return columns <= 4 || (columns <= 16 && zeros < 0.8) || (columns <= 48 && zeros < 0.1) || zeros < 0.05;
}

// Neighbouring columns of one structure, or nearly so.
std::vector<Group> groups(const Rows &parent, const std::vector<Rows> &below) {
  std::vector<Group> found;
  for (int32_t j = 0; j < static_cast<int32_t>(parent.size()); ++j) {
    found.push_back({j, j, 1.0 + static_cast<double>(below[j].size())});
    while (found.size() > 1) {
      Group &lower = found[found.size() - 2], &upper = found.back();
      if (parent[lower.last] < upper.first || parent[lower.last] > upper.last) break;
      const double columns = upper.last - lower.first + 1, rest = static_cast<double>(below[upper.last].size());
      const double stored = columns * (columns + 1) / 2 + columns * rest, entries = lower.entries + upper.entries;
      if (!worth(static_cast<int32_t>(columns), 1 - entries / stored)) break;
      lower.last = upper.last;
      lower.entries = entries;
      found.pop_back();
    }
  }
  return found;
}

// Where the entries of the matrix go in the panel of a front; `local` gives rows their places in it.
void place_entries(Plan &plan, const Front &front, const Pattern &pattern, const Rows &local) {
  for (int32_t j = front.first; j < front.first + front.columns; ++j) {
    const int32_t *begin = pattern.row + pattern.start[j], *end = pattern.row + pattern.start[j + 1];
    const int32_t *own = std::lower_bound(begin, end, j);
    if (own == end || *own != j) throw std::invalid_argument("a diagonal entry is missing");
    plan.diagonal.push_back(static_cast<int32_t>(own - pattern.row));
    for (const int32_t *i = own; i != end; ++i) {
      plan.source.push_back(static_cast<int32_t>(i - pattern.row));
      plan.target.push_back(front.panel + static_cast<int64_t>(j - front.first) * front.height() + local[*i]);
    }
  }
}

// The next front, of a group of columns and the rows below the last of them.
void add_front(Plan &plan, const Group &group, const Rows &below, const Pattern &pattern, Rows &local) {
  Front front;
  front.first = group.first;
  front.columns = group.last - group.first + 1;
  front.below = static_cast<int32_t>(below.size());
  front.rows = static_cast<int64_t>(plan.row.size());
  front.panel = plan.panels;
  front.entries = static_cast<int64_t>(plan.source.size());
  plan.row.insert(plan.row.end(), below.begin(), below.end());
  for (int32_t k = 0; k < front.columns; ++k) local[front.first + k] = k;
  for (int32_t k = 0; k < front.below; ++k) local[below[k]] = front.columns + k;
  place_entries(plan, front, pattern, local);
  front.last = static_cast<int64_t>(plan.source.size());
  plan.panels += static_cast<int64_t>(front.height()) * front.columns;
  plan.highest = std::max(plan.highest, front.height());
  plan.front.push_back(front);
}

// Where the rows below a front stand in its parent.
void settle(Plan &plan, const Front &front) {
  const Front &parent = plan.front[front.parent];
  const int32_t end = parent.first + parent.columns;
  const auto begin = plan.row.begin() + parent.rows;
  auto at = begin;
  for (int64_t k = front.rows; k < front.rows + front.below; ++k) {
    const int32_t i = plan.row[k];
    if (i >= end) at = std::lower_bound(at, begin + parent.below, i);
    plan.place[k] = i < end ? i - parent.first : parent.columns + static_cast<int32_t>(at - begin);
  }
}

// Places for what fronts leave, used again once the parent has it: two stacks, for generations in turn, so that a front
// and its children never share one. Where children are not on top, every front has a place of its own.
void share_memory(Plan &plan) {
  const int32_t count = static_cast<int32_t>(plan.front.size());
  Rows generation(count, 0), on_top[2];
  for (int32_t f = count - 1; f >= 0; --f)
    if (plan.front[f].parent >= 0) generation[f] = 1 - generation[plan.front[f].parent];
  int64_t used[2] = {}, most[2] = {}, all = 0;
  bool stacked = true;
  for (int32_t f = 0; f < count && stacked; ++f) {
    Front &front = plan.front[f];
    const int own = generation[f], other = 1 - own;
    front.rest = used[own];
    used[own] += front.square();
    most[own] = std::max(most[own], used[own]);
    on_top[own].push_back(f);
    for (auto child = front.children.rbegin(); child != front.children.rend() && stacked; ++child) {
      stacked = !on_top[other].empty() && on_top[other].back() == *child;
      if (!stacked) break;
      on_top[other].pop_back();
      used[other] -= plan.front[*child].square();
    }
  }
  for (int32_t f = 0; f < count; ++f) {
    Front &front = plan.front[f];
    front.rest = stacked ? front.rest + generation[f] * most[0] : all;
    all += front.square();
  }
  plan.rests = stacked ? most[0] + most[1] : all;
}

}  // namespace

Plan make_plan(int64_t size, const int32_t *start, const int32_t *row) {
  const Pattern pattern{static_cast<int32_t>(size), start, row};
  const Rows parent = elimination_tree(pattern);
  std::vector<Rows> below = structures(pattern, parent);
  Plan plan;
  plan.size = size;
  Rows holder(size), local(size);
  for (const Group &group : groups(parent, below)) {
    std::sort(below[group.last].begin(), below[group.last].end());
    std::fill(holder.begin() + group.first, holder.begin() + group.last + 1, static_cast<int32_t>(plan.front.size()));
    add_front(plan, group, below[group.last], pattern, local);
  }
  plan.place.resize(plan.row.size());
  for (int32_t f = 0; f < static_cast<int32_t>(plan.front.size()); ++f) {
    Front &front = plan.front[f];
    const int32_t above = parent[front.first + front.columns - 1];
    if (above < 0) continue;
    front.parent = holder[above];
    plan.front[front.parent].children.push_back(f);
    settle(plan, front);
  }
  share_memory(plan);
  return plan;
}

}  // namespace cholesky
