// Matching with the pixels that can be seen: those that are saturated in either picture say nothing.
#pragma once
#include "subset.hpp"

namespace dic {

// May a pixel of the subset that the warp carries into the picture be blind or dark there?
bool limited_about(const Picture &picture, Point centre, const Warp &warp, int half);

// Is a pixel saturated, or beside one that is, here or where the warp carries it?
bool blind(const Pixels &pixels, int i, const Picture &current, Point centre, const Warp &warp);

// As fit(), without the pixels that are blind in either picture; they are taken out of `pixels`. Saturated: too little
// is left.
Fit fit_seen(Pixels &pixels, const Picture &current, Point centre, const Warp &guess, const Settings &settings,
             Bench &bench, const Prior *prior = nullptr);

}  // namespace dic
