//! A vector register with arithmetic.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use super::Real;

/// One register of `S` full of `A`; operations act lane by lane.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<S: Simd, A: Real> {
    simd: S,
    register: A::Register<S>,
}

impl<S: Simd, A: Real> Lanes<S, A> {
    #[inline(always)]
    pub(crate) fn new(simd: S, register: A::Register<S>) -> Self {
        Self { simd, register }
    }

    /// The same value in every lane.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: A) -> Self {
        Self::new(simd, A::splat(simd, value))
    }

    /// This constant in every lane.
    #[inline(always)]
    pub(crate) fn constant(self, value: A) -> Self {
        Self::splat(self.simd, value)
    }

    #[inline(always)]
    pub(crate) fn register(self) -> A::Register<S> {
        self.register
    }

    /// $ab + c$, rounded once where the level has fused multiply-add.
    #[inline(always)]
    pub(crate) fn mul_add(self, b: Self, c: Self) -> Self {
        Self::new(
            self.simd,
            A::mul_add_lanes(self.simd, self.register, b.register, c.register),
        )
    }

    /// $c - ab$, rounded as [`mul_add`](Self::mul_add).
    #[inline(always)]
    pub(crate) fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self::new(
            self.simd,
            A::neg_mul_add_lanes(self.simd, self.register, b.register, c.register),
        )
    }

    /// $c - ab$, rounded once on every level (slowly where there is no fused multiply-add).
    #[inline(always)]
    pub(crate) fn fused_neg_mul_add(self, b: Self, c: Self) -> Self {
        Self::new(
            self.simd,
            A::fused_neg_mul_add_lanes(self.simd, self.register, b.register, c.register),
        )
    }

    /// The polynomial with these coefficients, the constant term first, by Horner's rule.
    #[inline(always)]
    pub(crate) fn polynomial(self, coefficients: &[A]) -> Self {
        let Some((&last, rest)) = coefficients.split_last() else {
            return self.constant(A::ZERO);
        };
        let mut sum = self.constant(last);
        for &coefficient in rest.iter().rev() {
            sum = sum.mul_add(self, self.constant(coefficient));
        }
        sum
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self::new(self.simd, A::sqrt_lanes(self.simd, self.register))
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self::new(self.simd, A::abs_lanes(self.simd, self.register))
    }

    /// The magnitude of `self` with the sign of `other`; `self` must not be negative.
    #[inline(always)]
    pub(crate) fn with_sign_of(self, other: Self) -> Self {
        let sign = A::and_lanes(
            self.simd,
            other.register,
            A::splat(self.simd, A::MINUS_ZERO),
        );
        Self::new(self.simd, A::or_lanes(self.simd, self.register, sign))
    }

    /// Flips signs where the sign bit of `other` is set.
    #[inline(always)]
    pub(crate) fn flip_sign(self, other: Self) -> Self {
        Self::new(
            self.simd,
            A::xor_lanes(self.simd, self.register, other.register),
        )
    }

    /// The smaller of `self` and `limit`; NaN stays NaN.
    #[inline(always)]
    pub(crate) fn at_most(self, limit: A) -> Self {
        let limit = self.constant(limit);
        // A comparison, because the minimum of NaN and a number differs between processors.
        let above = A::less(self.simd, limit.register, self.register);
        Self::new(
            self.simd,
            A::select(self.simd, above, limit.register, self.register),
        )
    }

    /// `if_less` where `self < bound`, otherwise (and for NaN) `otherwise`.
    #[inline(always)]
    pub(crate) fn where_less(self, bound: A, if_less: Self, otherwise: Self) -> Self {
        let less = A::less(self.simd, self.register, A::splat(self.simd, bound));
        Self::new(
            self.simd,
            A::select(self.simd, less, if_less.register, otherwise.register),
        )
    }

    /// `if_so` where `self >= bound`, otherwise (and for NaN) `otherwise`.
    #[inline(always)]
    pub(crate) fn where_at_least(self, bound: A, if_so: Self, otherwise: Self) -> Self {
        let at_least = A::less_or_equal(self.simd, A::splat(self.simd, bound), self.register);
        Self::new(
            self.simd,
            A::select(self.simd, at_least, if_so.register, otherwise.register),
        )
    }

    /// The larger; which of the two it is where one is NaN differs between processors.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self::new(
            self.simd,
            A::max_lanes(self.simd, self.register, other.register),
        )
    }

    /// The largest lane, with the same reserve about NaN.
    #[inline(always)]
    pub(crate) fn largest(self) -> A {
        A::reduce_max(self.simd, self.register)
    }

    /// The integer nearest to `self * factor`, for magnitudes below 2^21 (`f32`) or 2^50 (`f64`).
    #[inline(always)]
    pub(crate) fn round_product(self, factor: A) -> Self {
        // At 1.5 * 2^(digits - 1) the unit in the last place is 1.
        let magic = self.constant(A::ROUND);
        self.mul_add(self.constant(factor), magic) - magic
    }

    /// $2^n$ for an integer $n$ in `self` such that $2^n$ is a normal number.
    #[inline(always)]
    pub(crate) fn power_of_two(self) -> Self {
        let biased = self + self.constant(A::EXPONENT_MAGIC);
        Self::new(self.simd, A::shift_to_exponent(self.simd, biased.register))
    }

    /// The sign bit set where the integer `self` is odd, all other bits 0.
    #[inline(always)]
    pub(crate) fn odd_as_sign(self) -> Self {
        let magic = self + self.constant(A::PARITY_MAGIC);
        Self::new(self.simd, A::shift_to_sign(self.simd, magic.register))
    }

    /// $a^2 - \mathrm{square}$ for `square` the rounded square of `self`: what rounding lost.
    #[inline(always)]
    pub(crate) fn square_error(self, square: Self) -> Self {
        if !S::IS_SCALAR {
            return self.mul_add(self, -square);
        }
        // Veltkamp's split and Dekker's product (1971), where there is no fused multiply-add.
        let scaled = self * self.constant(A::SPLIT);
        let high = scaled - (scaled - self);
        let low = self - high;
        ((high * high - square) + (high * low + high * low)) + low * low
    }
}

impl<S: Simd, A: Real> Add for Lanes<S, A> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(
            self.simd,
            A::add_lanes(self.simd, self.register, other.register),
        )
    }
}

impl<S: Simd, A: Real> Sub for Lanes<S, A> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(
            self.simd,
            A::sub_lanes(self.simd, self.register, other.register),
        )
    }
}

impl<S: Simd, A: Real> Mul for Lanes<S, A> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::new(
            self.simd,
            A::mul_lanes(self.simd, self.register, other.register),
        )
    }
}

impl<S: Simd, A: Real> Div for Lanes<S, A> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self::new(
            self.simd,
            A::div_lanes(self.simd, self.register, other.register),
        )
    }
}

impl<S: Simd, A: Real> Neg for Lanes<S, A> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.simd, A::neg_lanes(self.simd, self.register))
    }
}
