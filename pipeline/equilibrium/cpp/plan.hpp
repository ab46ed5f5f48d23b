// The plan of a factorisation: fronts of columns that are eliminated together, and where every number goes.
#pragma once

#include <cstdint>
#include <vector>

namespace cholesky {

constexpr int kLanes = 8;  // numbers that are worked on at once; what stands in columns is filled up to multiples of it

constexpr int32_t filled(int32_t count) { return (count + kLanes - 1) / kLanes * kLanes; }

struct Front {
  int32_t first = 0, columns = 0;   // eliminated here
  int32_t below = 0;                // further rows
  int32_t parent = -1;              // front that takes in what these rows are left with
  int64_t rows = 0;                 // where these rows begin in Plan::row, their places in the parent in Plan::place
  int64_t panel = 0;                // where the (height, columns) numbers begin, column by column; behind them
                                    // the inverses of the (kLanes, kLanes) blocks on their diagonal
  int64_t rest = 0;                 // where the (below, below) numbers left for the parent begin
  int64_t entries = 0, last = 0;    // of the matrix, in Plan::source and Plan::target
  std::vector<int32_t> children{};  // in the order of elimination

  int32_t top() const { return filled(columns); }  // where the further rows begin in a column
  int32_t height() const { return top() + filled(below); }
  int64_t square() const { return static_cast<int64_t>(below) * below; }
};

struct Plan {
  int64_t size = 0;               // variables
  int64_t panels = 0, rests = 0;  // numbers kept, and needed on the way
  int32_t highest = 0;            // front
  std::vector<int32_t> order;     // the variable that is eliminated at each place
  std::vector<Front> front;       // children before parents
  std::vector<int32_t> row, place;
  std::vector<int32_t> source;    // stored entry of the matrix
  std::vector<int64_t> target;    // its place in the panels
  std::vector<int32_t> diagonal;  // stored entry of every variable's own
};

// The plan of a symmetric pattern in compressed columns.
Plan make_plan(int64_t size, const int32_t *start, const int32_t *row);

}  // namespace cholesky
