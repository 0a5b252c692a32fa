// SPDX-License-Identifier: Apache-2.0
// Sums of floats that do not depend on the order of the additions: a long fixed-point accumulator
// (Kulisch and Miranker 1986; for reproducible sums on GPUs: Collange, Defour, Graillat and
// Iakymchuk 2015) of RS_EXACT_WORDS 32-bit words that integer atomics of OpenCL 1.2 add to. A float
// touches two words, a carry rarely a third: every word starts at RS_EXACT_BIAS, in the middle of
// its range, so that sums around zero do not send borrows to the top.
//
// Words of one sum lie 16 apart, because 16 sums are updated together. The lowest bit weighs
// 2^RS_EXACT_LOW; what lies below is cut off, for every addend alike. An addend at or above `limit`
// in absolute value, or one that is not finite, makes the sum NaN. The sums stay in range when
// limit times the number of addends is at most 2^RS_EXACT_HIGH: gradients of lines grow with no
// more than the square of the scene's size, and those of a view of 2^24 pixels of a scene of 10^7
// units fit.
#ifndef RS_TRACE_EXACT_SUM_H
#define RS_TRACE_EXACT_SUM_H

#define RS_EXACT_WORDS 6
#define RS_EXACT_LOW (-110)
#define RS_EXACT_HIGH 77
#define RS_EXACT_BIAS 0x80000000u

#ifdef __OPENCL_C_VERSION__
// Sums in range keep the top word within 2^27 of the bias; a sum that was raised to the mark stays
// above the threshold.
#define RS_EXACT_MARK 0xf0000000u
#define RS_EXACT_IS_MARKED 0xc0000000u

void rs_exact_add(volatile __global uint* words, const float value, const float limit) {
  if (value == 0.0f) return;
  if (!(fabs(value) < limit)) {
    atomic_max(words + 16 * (RS_EXACT_WORDS - 1), RS_EXACT_MARK);
    return;
  }
  const uint bits = as_uint(value);
  const bool negative = bits >> 31;
  const int exponent = max((int)(bits >> 23 & 0xff), 1);
  uint mantissa = (bits & 0x7fffff) | ((bits >> 23 & 0xff) == 0 ? 0 : 0x800000);
  int place = exponent - 150 - RS_EXACT_LOW;  // of the mantissa's lowest bit
  if (place < 0) {
    mantissa = place > -24 ? mantissa >> -place : 0;
    place = 0;
  }
  const ulong part = (ulong)mantissa << (place & 31);
  words += 16 * (place >> 5);
  uint rest = (uint)part;
  const uint high = (uint)(part >> 32);
  for (int word = place >> 5; word < RS_EXACT_WORDS; ++word, words += 16) {
    bool carry = false;
    if (rest != 0) {
      const uint old = atomic_add(words, negative ? -rest : rest);
      carry = negative ? old < rest : old > ~rest;
    }
    rest = (word == place >> 5 ? high : 0) + carry;
    if (rest == 0) return;
  }
}

// The value of a sum, rounded to a float, from its words.
float rs_exact_value(const uint* words) {
  if (words[RS_EXACT_WORDS - 1] >= RS_EXACT_IS_MARKED) return NAN;
  uint digits[RS_EXACT_WORDS];
  ulong borrow = 0;
  for (int k = 0; k < RS_EXACT_WORDS; ++k) {
    const ulong difference = (ulong)words[k] - RS_EXACT_BIAS - borrow;
    digits[k] = (uint)difference;
    borrow = difference >> 63;
  }
  const bool negative = borrow != 0;
  if (negative) {
    ulong carry = 1;
    for (int k = 0; k < RS_EXACT_WORDS; ++k) {
      const ulong sum = (ulong)(~digits[k]) + carry;
      digits[k] = (uint)sum;
      carry = sum >> 32;
    }
  }
  int top = RS_EXACT_WORDS - 1;
  while (top > 0 && digits[top] == 0) --top;
  const uint below = top > 0 ? digits[top - 1] : 0;
  const float head = convert_float((ulong)digits[top] << 32 | below);
  const float value = ldexp(head, 32 * (top - 1) + RS_EXACT_LOW);
  return negative ? -value : value;
}
#endif

#endif
