// Work shared among threads: no global state, the result does not depend on their number.
#pragma once
#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>
#include <vector>

namespace dic {

// Call task(i, worker) for every i in [0, count); `worker` numbers the thread so that it can keep scratch memory.
template <class Task> void parallel_for(int count, int threads, const Task &task) {
  const int workers = std::max(1, std::min(threads, count / 4 + 1));
  if (workers == 1) {
    for (int i = 0; i < count; ++i) task(i, 0);
    return;
  }
  std::atomic<int> next{0};
  std::vector<std::exception_ptr> failure(workers);
  auto run = [&](int worker) {
    try {
      for (int first = next.fetch_add(4); first < count; first = next.fetch_add(4))
        for (int i = first; i < std::min(first + 4, count); ++i) task(i, worker);
    } catch (...) {
      failure[worker] = std::current_exception();
    }
  };
  std::vector<std::thread> pool;
  pool.reserve(workers);
  try {
    for (int worker = 1; worker < workers; ++worker) pool.emplace_back(run, worker);
  } catch (const std::exception &) {  // no more threads are to be had: those that run do all of it
  }
  run(0);
  for (auto &thread : pool) thread.join();
  for (auto &f : failure)
    if (f) std::rethrow_exception(f);
}

}  // namespace dic
