//! The activation functions as formulas over vector registers.
//!
//! Three of them share one reduction. With $y = n \ln 2 + r$, $|r| \le \ln(2)/2$, and
//! $c = r \coth(r/2)$, which is even in $r$ and nearly constant,
//! $$ e^y = 2^n \frac{c + r}{c - r}, $$
//! so that the division that a sigmoid or a tangent needs anyway is the only one, and a short
//! polynomial for $c$ is the only approximation. Cody and Waite, *Software Manual for the
//! Elementary Functions* (1980), have the reduction.
//!
//! NaN goes through every formula and comes out as NaN.

use pulp::Simd;

use crate::simd::{Coefficients, Lanes};

/// $c = r \coth(r/2)$.
#[inline(always)]
fn coth<S: Simd, A: Coefficients>(r: Lanes<S, A>) -> Lanes<S, A> {
    let square = r * r;
    square
        .polynomial(A::COTH)
        .mul_add(square, r.constant(A::TWO))
}

/// $1 / (1 + e^{-z})$, accurate in both tails.
#[inline(always)]
pub(super) fn sigmoid<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let y = -z.abs().at_most(A::SIGMOID_LIMIT);
    let n = y.round_product(A::LOG2_E);
    let r = n.neg_mul_add(z.constant(A::LN_2_HIGH), y);
    let r = n.neg_mul_add(z.constant(A::LN_2_LOW), r);
    let c = coth(r);
    let lifted = (n + z.constant(A::LIFT_EXPONENT)).power_of_two() * (c + r);
    // e^{-|z|} is `lower` over `upper`.
    let (lower, upper) = (lifted * z.constant(A::LOWER), c - r);
    z.where_less(A::ZERO, lower, upper) / (upper + lower)
}

/// $\tanh z$, with $|\tanh z| = (1 - e^y)/(1 + e^y)$, $y = -2|z|$.
#[inline(always)]
pub(super) fn tanh<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let half = z.abs().at_most(A::TANH_LIMIT);
    let y = -(half + half);
    let n = y.round_product(A::LOG2_E);
    // One part of ln 2 is enough: its error is multiplied by 2^n.
    let r = n.neg_mul_add(z.constant(A::LN_2), y);
    let c = coth(r);
    let power = n.power_of_two();
    // For small z, n = 0: then `down` is 0, and the quotient is -r/c without cancellation.
    let (up, down) = (z.constant(A::ONE) + power, z.constant(A::ONE) - power);
    let numerator = r.neg_mul_add(up, c * down);
    let denominator = r.neg_mul_add(down, c * up);
    (numerator / denominator).with_sign_of(z)
}

/// $e^{-z^2}$. The rounding error of $z^2$, which the exponential would magnify up to 745 times,
/// is carried along.
#[inline(always)]
pub(super) fn gaussian<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let z = z.abs().at_most(A::GAUSSIAN_LIMIT);
    let square = z * z;
    let error = z.square_error(square);
    let n = (-square).round_product(A::LOG2_E);
    let r = n.neg_mul_add(z.constant(A::LN_2_HIGH), -square);
    let r = n.neg_mul_add(z.constant(A::LN_2_LOW), r) - error;
    let c = coth(r);
    let power = (n + z.constant(A::LIFT_EXPONENT)).power_of_two();
    power * ((c + r) / (c - r)) * z.constant(A::LOWER)
}

/// $\sin z$ for $|z|$ up to [`Coefficients::SINE_LIMIT`].
#[inline(always)]
pub(super) fn sine<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    reduced_sine(z, A::SINE)
}

/// [`sine`] with a relative error of 6e-9 beside rounding.
#[inline(always)]
pub(super) fn sine_fast<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    reduced_sine(z, A::SINE_FAST)
}

#[inline(always)]
fn reduced_sine<S: Simd, A: Coefficients>(z: Lanes<S, A>, polynomial: &[A]) -> Lanes<S, A> {
    let n = z.round_product(A::FRAC_1_PI);
    let mut r = z;
    for part in A::PI_PARTS {
        let part = z.constant(part);
        r = if A::PI_NEEDS_FUSED {
            n.fused_neg_mul_add(part, r)
        } else {
            n.neg_mul_add(part, r)
        };
    }
    // sin(n pi + r) = (-1)^n sin r.
    let square = r * r;
    // A product, not r plus a correction, so that -0 stays -0.
    let ratio = square
        .polynomial(polynomial)
        .mul_add(square, r.constant(A::ONE));
    (r * ratio).flip_sign(n.odd_as_sign())
}

/// $z / \sqrt{1 + z^2}$.
#[inline(always)]
pub(super) fn isru<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let x = z.abs().at_most(A::ISRU_LIMIT);
    (x / x.mul_add(x, x.constant(A::ONE)).sqrt()).with_sign_of(z)
}

/// $\max(0, z)$.
#[inline(always)]
pub(super) fn relu<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    z.where_less(A::ZERO, z.constant(A::ZERO), z)
}

/// $\max(0, z)^2$.
#[inline(always)]
pub(super) fn squared_relu<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let rectified = relu(z);
    rectified * rectified
}

/// 1 where $z \ge 0$, else 0.
#[inline(always)]
pub(super) fn hard_limit<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let (zero, one) = (z.constant(A::ZERO), z.constant(A::ONE));
    z.where_at_least(A::ZERO, one, z.where_less(A::ZERO, zero, z))
}

/// [`tanh`] with an absolute error of 4e-7, and of 4.5e-7 in `f32`.
#[inline(always)]
pub(super) fn tanh_fast<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let x = z.abs().at_most(A::TANH_FAST_LIMIT);
    let square = x * x;
    let (numerator, denominator) = A::TANH_FAST;
    (x * square.polynomial(&numerator) / square.polynomial(&denominator)).with_sign_of(z)
}

/// [`sigmoid`] as $(1 + \tanh(z/2))/2$: half the error of [`tanh_fast`].
#[inline(always)]
pub(super) fn sigmoid_fast<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let half = z.constant(A::HALF);
    tanh_fast(z * half).mul_add(half, half)
}

/// [`gaussian`] as $(e^{-z^2/16})^{16}$, without a division.
#[inline(always)]
pub(super) fn gaussian_fast<S: Simd, A: Coefficients>(z: Lanes<S, A>) -> Lanes<S, A> {
    let mut power = (z * z).at_most(A::EXP_FAST_LIMIT).polynomial(&A::EXP_FAST);
    for _ in 0..4 {
        power = power * power;
    }
    power
}
