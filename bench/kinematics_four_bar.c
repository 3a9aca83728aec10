// Copyright 2026 The linkage_ros authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

// What `linkage_ros.kinematics.batch.crank_rrr` does with numpy, for a four-bar without change
// point: the formulas that its head states, in the same order, halved and doubled alike. In
// blocks, so that the compiler can vectorise all but the calls of libm.

#include <math.h>

enum { BLOCK = 512 };

// constants: a, b, c, d, fold and stretch margin, the assembly, and what X·Y/4 must be above.
// position, velocity, acceleration: n of the coupler against the crank, then n of the rocker.
// Returns how many states are not closed, or too near a limit to tell.
long four_bar(const double *constants, long n, const double *phi, double rate,
              double acceleration, double *position, double *velocity, double *accelerations)
{
  const double a = constants[0], b = constants[1], c = constants[2], d = constants[3];
  const double pivots = d - a, sides = 0.5 * (b - c) * (b + c);
  const double fold = 0.5 * constants[4] * (fabs(pivots) + fabs(b - c));
  const double stretch = 0.5 * constants[5] * (a + b + c + d);
  const double root = sqrt(2.0) * sqrt(a) * sqrt(d), lengths = 0.5 * pivots * (d + a);
  const double half_more = sides + 0.5 * pivots * pivots;
  const double half_less = sides - 0.5 * pivots * pivots;
  const double sign = constants[6], tolerance = constants[7];
  const double half_rate = 0.5 * rate, half_square = 0.5 * rate * rate;
  const double half_acceleration = 0.5 * acceleration;
  long odd = 0;

  for (long start = 0; start < n; start += BLOCK) {
    const int count = n - start < BLOCK ? (int)(n - start) : BLOCK;
    const double *restrict angle = phi + start;
    double *restrict coupler = position + start, *restrict rocker = position + n + start;
    double *restrict omega3 = velocity + start, *restrict omega4 = velocity + n + start;
    double *restrict alpha3 = accelerations + start, *restrict alpha4 = accelerations + n + start;
    double t[BLOCK], near[BLOCK], far[BLOCK], mixed[BLOCK], x[BLOCK], y[BLOCK], cross[BLOCK];
    double s[BLOCK], plus[BLOCK], minus[BLOCK], turn[BLOCK];

    for (int i = 0; i < count; ++i) {
      t[i] = tan(0.25 * angle[i]);
    }
    for (int i = 0; i < count; ++i) {
      const double square = t[i] * t[i];
      const double sine = t[i] / (1.0 + square), cosine = (1.0 - square) / (1.0 + square);
      const double near_root = 2.0 * root * sine, far_root = root * cosine;
      mixed[i] = near_root * far_root;
      near[i] = near_root * near_root;
      far[i] = far_root * far_root;
      s[i] = near[i] + 0.5 * pivots * pivots;
      x[i] = near[i] + fold;
      y[i] = far[i] + stretch;
      const double product = x[i] * y[i];
      odd += !(product > tolerance);
      cross[i] = sign * sqrt(product);
      plus[i] = half_more + near[i];
      minus[i] = half_less - near[i];
      turn[i] = near[i] + d * pivots;
    }
    for (int i = 0; i < count; ++i) {
      turn[i] = atan2(mixed[i], turn[i]);
    }
    for (int i = 0; i < count; ++i) {
      coupler[i] = atan2(cross[i], plus[i]) - turn[i] - angle[i];
    }
    for (int i = 0; i < count; ++i) {
      rocker[i] = atan2(cross[i], minus[i]) - turn[i];
    }
    for (int i = 0; i < count; ++i) {
      const double p = (a * pivots - near[i]) / s[i], q = mixed[i] / s[i], r = q / cross[i];
      const double first = r * minus[i] - p, second = r * plus[i] - p;
      omega3[i] = first * half_rate - rate;
      omega4[i] = second * half_rate;
      const double e =
          (0.5 * fold * far[i] / x[i] - 0.5 * stretch * near[i] / y[i]) / s[i] / cross[i];
      const double rest = (lengths / s[i] - r * sides) * q;
      alpha3[i] =
          (e * minus[i] + rest) * half_square + first * half_acceleration - acceleration;
      alpha4[i] = (e * plus[i] + rest) * half_square + second * half_acceleration;
    }
  }
  return odd;
}
