/* SPDX-License-Identifier: GPL-2.0-or-later */

#include "cohesive_coeff.h"

#include <cstdio>
#include <cstdlib>

namespace cohesive {

static const char *const SHAPES[] = {"linear", "exponential", "bilinear-tail"};

static std::string text(const char *format, double value)
{
  char buffer[64];
  std::snprintf(buffer, sizeof(buffer), format, value);
  return buffer;
}

// "name = value unit must be rule"
static std::string broken(const char *name, double value, const char *unit, const char *rule)
{
  return std::string(name) + " = " + text("%g", value) + unit + " must be " + rule;
}

static bool positive(double value)
{
  return std::isfinite(value) && value > 0.0;
}

static std::string complaint_of_sliding(const Law &law)
{
  if (!positive(law.k_s)) return broken("k_s", law.k_s, " N/m", "finite and positive");
  if (law.damageable()) {
    if (!positive(law.f_shear)) return broken("f_shear", law.f_shear, " N", "finite and positive");
    if (!positive(law.delta_shear)) return broken("delta_shear", law.delta_shear, " m", "finite and positive");
  } else if (std::isfinite(law.f_shear)) {
    return broken("f_shear", law.f_shear, " N", "inf where f_max is: a bond takes damage in both modes or in none");
  }
  if (!(std::isfinite(law.friction) && law.friction >= 0.0))
    return broken("friction", law.friction, "", "finite and zero or positive");
  return "";
}

static std::string complaint_of_arms(const Law &law)
{
  double sum = 0.0;
  for (int a = 0; a < law.arms; a++) {
    if (!positive(law.share[a])) return broken("share", law.share[a], " of an arm", "finite and positive");
    if (!positive(law.time[a])) return broken("time", law.time[a], " s of an arm", "finite and positive");
    sum += law.share[a];
  }
  return sum > 1.0 + 1e-9 ? broken("sum of shares", sum, " of the arms", "at most 1") : "";
}

std::string complaint(const Law &law)
{
  if (!positive(law.k_n)) return broken("k_n", law.k_n, " N/m", "finite and positive");
  if (!(law.f_max > 0.0)) return broken("f_max", law.f_max, " N", "positive (inf: the bond takes no damage)");
  if (law.damageable() && !positive(law.delta_max))
    return broken("delta_max", law.delta_max, " m", "finite and positive");
  if (law.k_s != 0.0) {
    const std::string sliding = complaint_of_sliding(law);
    if (!sliding.empty()) return sliding;
  }
  if (law.damageable() && !law.creeps() && !(law.delta_max > law.delta_peak()))
    return "delta_max = " + text("%g", law.delta_max) + " m must be larger than delta_peak = f_max/k_n = " +
        text("%g", law.delta_peak()) + " m: raise delta_max or lower f_max";
  if (law.slides() && law.damageable() && !(law.delta_shear > law.f_shear / law.k_s))
    return "delta_shear = " + text("%g", law.delta_shear) + " m must be larger than f_shear/k_s = " +
        text("%g", law.f_shear / law.k_s) + " m: raise delta_shear or lower f_shear";
  if (!(law.softening.tail >= 0.0 && law.softening.tail <= 1.0))
    return broken("tail", law.softening.tail, "", "between 0 (linear) and 1 (long tail)");
  if (law.friction != 0.0 && !law.slides())
    return "friction = " + text("%g", law.friction) + " needs bonds that slide: give shear K_S F_SHEAR DELTA_SHEAR";
  if (law.creeps() && law.slides()) return "bonds that relax cannot have a shear stiffness in this version";
  return complaint_of_arms(law);
}

namespace {

// the words of a line, one after the other
struct Words {
  const std::vector<std::string> &words;
  size_t at = 0;
  std::string wrong{};

  bool more() const { return wrong.empty() && at < words.size(); }

  std::string next(const char *what)
  {
    if (at < words.size()) return words[at++];
    if (wrong.empty()) wrong = std::string(what) + " is missing";
    return "";
  }

  double number(const char *what)
  {
    const std::string word = next(what);
    if (!wrong.empty()) return 0.0;
    if (word == "inf") return INFINITY;
    char *end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != '\0' || std::isinf(value)) wrong = std::string(what) + " = " + word + " must be a number";
    return value;
  }
};

}    // namespace

static void read_softening(Words &words, Law &law)
{
  const std::string name = words.next("softening");
  for (int shape = 0; shape < 3; shape++)
    if (name == SHAPES[shape]) law.softening.shape = static_cast<Softening::Shape>(shape);
  if (name != SHAPES[law.softening.shape])
    words.wrong = "softening = " + name + " must be linear, exponential or bilinear-tail";
  else if (law.softening.shape == Softening::BILINEAR_TAIL)
    law.softening.tail = words.number("tail");
}

static void read_unloading(Words &words, Law &law)
{
  const std::string name = words.next("unloading");
  law.elastic_unloading = name == "elastic";
  if (name != "elastic" && name != "secant") words.wrong = "unloading = " + name + " must be secant or elastic";
}

static void read_arms(Words &words, Law &law)
{
  const double count = words.number("number of arms of relax");
  law.arms = count >= 1.0 && count <= MOST_ARMS ? static_cast<int>(count) : 0;
  if (words.wrong.empty() && (law.arms == 0 || law.arms != count))
    words.wrong = "relax = " + text("%g", count) + " must be a whole number of arms, 1 to " + std::to_string(MOST_ARMS);
  for (int a = 0; a < law.arms; a++) {
    law.share[a] = words.number("share of an arm");
    law.time[a] = words.number("time of an arm");
  }
}

static void read_option(Words &words, Law &law)
{
  const std::string key = words.next("keyword");
  if (key == "shear") {
    law.k_s = words.number("k_s");
    law.f_shear = words.number("f_shear");
    law.delta_shear = words.number("delta_shear");
    if (words.wrong.empty() && law.k_s == 0.0) words.wrong = broken("k_s", 0.0, " N/m", "finite and positive");
  } else if (key == "softening") {
    read_softening(words, law);
  } else if (key == "unloading") {
    read_unloading(words, law);
  } else if (key == "friction") {
    law.friction = words.number("friction");
  } else if (key == "relax") {
    read_arms(words, law);
  } else {
    words.wrong = "bond_coeff of cohesive does not know '" + key +
        "': after k_n, f_max and delta_max it takes shear, softening, unloading, friction and relax";
  }
}

std::string read_law(const std::vector<std::string> &given, Law &law)
{
  Words words{given};
  law = Law();
  law.k_n = words.number("k_n");
  law.f_max = words.number("f_max");
  law.delta_max = words.number("delta_max");
  if (!words.wrong.empty()) return "bond_coeff of cohesive takes a type, k_n, f_max and delta_max: " + words.wrong;
  while (words.more()) read_option(words, law);
  return words.wrong.empty() ? complaint(law) : words.wrong;
}

std::string write_law(const Law &law)
{
  const auto exact = [](double value) { return " " + text("%.17g", value); };
  std::string line = text("%.17g", law.k_n) + exact(law.f_max) + exact(law.delta_max);
  if (law.slides()) line += " shear" + exact(law.k_s) + exact(law.f_shear) + exact(law.delta_shear);
  if (law.softening.shape != Softening::LINEAR) line += std::string(" softening ") + SHAPES[law.softening.shape];
  if (law.softening.shape == Softening::BILINEAR_TAIL) line += exact(law.softening.tail);
  if (law.elastic_unloading) line += " unloading elastic";
  if (law.friction > 0.0) line += " friction" + exact(law.friction);
  if (law.creeps()) line += " relax " + std::to_string(law.arms);
  for (int a = 0; a < law.arms; a++) line += exact(law.share[a]) + exact(law.time[a]);
  return line;
}

}    // namespace cohesive
