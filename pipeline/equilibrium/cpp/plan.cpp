#include "plan.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace cholesky {
namespace {

using Rows = std::vector<int32_t>;

struct Pattern {
  int32_t size;
  const int32_t *start, *row;
};

// The lower half of a pattern in another order: rows of every column, ascending, and where the matrix stores each.
struct Lower {
  Rows start, row, entry;
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

// Places of the variables in an order that goes through the tree branch by branch: as good, and columns that can be
// eliminated together become neighbours.
Rows branch_by_branch(const Rows &parent) {
  const int32_t size = static_cast<int32_t>(parent.size());
  Rows descendants(size, 1), place(size), free(size);
  for (int32_t j = 0; j < size; ++j)
    if (parent[j] >= 0) descendants[parent[j]] += descendants[j];
  int32_t last = size;  // free place from the end of what is taken by roots, as `free` below each variable
  for (int32_t j = size - 1; j >= 0; --j) {
    int32_t &end = parent[j] >= 0 ? free[parent[j]] : last;
    place[j] = free[j] = end - 1;
    end -= descendants[j];
  }
  return place;
}

// The lower half of the pattern in the order (n,) of its variables with their places (n,).
Lower reordered(const Pattern &pattern, const Rows &order, const Rows &place) {
  Lower lower{Rows(pattern.size + 1, 0), Rows(), Rows()};
  const auto each = [&](const auto &take) {  // entry by entry, rows ascending
    for (int32_t i = 0; i < pattern.size; ++i)
      for (int32_t k = pattern.start[order[i]]; k < pattern.start[order[i] + 1]; ++k)
        if (place[pattern.row[k]] <= i) take(i, place[pattern.row[k]], k);  // K is symmetric: column i for row i
  };
  each([&](int32_t, int32_t j, int32_t) { ++lower.start[j + 1]; });
  std::partial_sum(lower.start.begin(), lower.start.end(), lower.start.begin());
  lower.row.resize(lower.start.back());
  lower.entry.resize(lower.start.back());
  Rows next(lower.start.begin(), lower.start.end() - 1);
  each([&](int32_t i, int32_t j, int32_t k) {
    lower.row[next[j]] = i;
    lower.entry[next[j]++] = k;
  });
  return lower;
}

// Rows below the diagonal of every column of the factor: its own and those of its children, in no order.
std::vector<Rows> structures(const Lower &pattern, const Rows &parent) {
  const int32_t size = static_cast<int32_t>(parent.size());
  std::vector<Rows> below(size), children(size);
  Rows seen(size, -1);
  for (int32_t j = 0; j < size; ++j) {
    const auto take = [&](int32_t i) {
      if (i <= j || seen[i] == j) return;
      seen[i] = j;
      below[j].push_back(i);
    };
    std::for_each(pattern.row.begin() + pattern.start[j], pattern.row.begin() + pattern.start[j + 1], take);
    for (const int32_t child : children[j]) std::for_each(below[child].begin(), below[child].end(), take);
    if (parent[j] >= 0) children[parent[j]].push_back(j);
  }
  return below;
}

// Whether storing so many zeros is worth one front less: they are read in the time that it takes to begin one.
bool worth(double zeros, double stored) { return zeros <= 256 || zeros < 0.05 * stored; }

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
      if (!worth(stored - entries, stored)) break;
      lower.last = upper.last;
      lower.entries = entries;
      found.pop_back();
    }
  }
  return found;
}

// Where the entries of the matrix go in the panel of a front; `local` gives rows their places in it.
void place_entries(Plan &plan, const Front &front, const Lower &pattern, const Rows &local) {
  for (int32_t j = front.first; j < front.first + front.columns; ++j) {
    const int32_t begin = pattern.start[j], end = pattern.start[j + 1];
    if (begin == end || pattern.row[begin] != j) throw std::invalid_argument("a diagonal entry is missing");
    plan.diagonal.push_back(pattern.entry[begin]);
    for (int32_t k = begin; k < end; ++k) {
      plan.source.push_back(pattern.entry[k]);
      const int64_t column = front.panel + static_cast<int64_t>(j - front.first) * front.height();
      plan.target.push_back(column + local[pattern.row[k]]);
    }
  }
}

// The next front, of a group of columns and the rows below the last of them.
void add_front(Plan &plan, const Group &group, const Rows &below, const Lower &pattern, Rows &local) {
  Front front;
  front.first = group.first;
  front.columns = group.last - group.first + 1;
  front.below = static_cast<int32_t>(below.size());
  front.rows = static_cast<int64_t>(plan.row.size());
  front.panel = plan.panels;
  front.entries = static_cast<int64_t>(plan.source.size());
  plan.row.insert(plan.row.end(), below.begin(), below.end());
  for (int32_t k = 0; k < front.columns; ++k) local[front.first + k] = k;
  for (int32_t k = 0; k < front.below; ++k) local[below[k]] = front.top() + k;
  place_entries(plan, front, pattern, local);
  front.last = static_cast<int64_t>(plan.source.size());
  plan.panels += static_cast<int64_t>(front.height()) * front.columns + front.top() * kLanes;
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
    plan.place[k] = i < end ? i - parent.first : parent.top() + static_cast<int32_t>(at - begin);
  }
}

// Places for what fronts leave, used again once the parent has it: two stacks, for generations in turn, so that a front
// and its children never share one. Branch by branch, the children of a front are on top.
void share_memory(Plan &plan) {
  const int32_t count = static_cast<int32_t>(plan.front.size());
  Rows generation(count, 0);
  for (int32_t f = count - 1; f >= 0; --f)
    if (plan.front[f].parent >= 0) generation[f] = 1 - generation[plan.front[f].parent];
  int64_t used[2] = {}, most[2] = {};
  for (int32_t f = 0; f < count; ++f) {
    Front &front = plan.front[f];
    const int own = generation[f];
    front.rest = used[own];
    used[own] += front.square();
    most[own] = std::max(most[own], used[own]);
    for (const int32_t child : front.children) used[1 - own] -= plan.front[child].square();
  }
  for (int32_t f = 0; f < count; ++f) plan.front[f].rest += generation[f] * most[0];
  plan.rests = most[0] + most[1];
}

}  // namespace

Plan make_plan(int64_t size, const int32_t *start, const int32_t *row) {
  const Pattern given{static_cast<int32_t>(size), start, row};
  const Rows tree = elimination_tree(given), to = branch_by_branch(tree);
  Plan plan;
  plan.size = size;
  plan.order.resize(size);
  Rows parent(size), holder(size), local(size);
  for (int32_t j = 0; j < size; ++j) {
    plan.order[to[j]] = j;
    parent[to[j]] = tree[j] < 0 ? -1 : to[tree[j]];
  }
  const Lower pattern = reordered(given, plan.order, to);
  std::vector<Rows> below = structures(pattern, parent);
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
