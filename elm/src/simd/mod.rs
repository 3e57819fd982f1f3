//! Vector registers: one formula, written once, for every vector unit and both scalar types.
//!
//! [`Level`] picks the processor's best vector unit at run time: AVX-512, AVX2 with FMA, NEON, or
//! one lane at a time. [`Lanes`] is a register of it with arithmetic, [`Real`] what differs
//! between `f32` and `f64`. The crate `pulp` does the dispatch and holds the intrinsics.
//!
//! Every level but the last has fused multiply-add and the same operations in the same order, so
//! results there are the same bits. [`pulp::Scalar`] rounds after each multiplication: it differs
//! by rounding, serves processors without FMA, and is what tests hold the others against.
//!
//! Registers must not pass through closures: those are compiled without the vector unit, and each
//! operation in them becomes a call. Hence plain loops, and `inline(always)` throughout.

mod coefficients;
mod lanes;
mod real;

use std::fmt;

use aligned_vec::{AVec, ConstAlign};
use pulp::{Arch, Simd, WithSimd};

pub(crate) use coefficients::Coefficients;
pub(crate) use lanes::Lanes;
pub(crate) use real::Real;

/// Memory that starts at a cache line.
pub(crate) type Aligned<A> = AVec<A, ConstAlign<64>>;

pub(crate) fn zeros<A: Real>(length: usize) -> Aligned<A> {
    AVec::from_iter(64, std::iter::repeat_n(A::ZERO, length))
}

/// Which vector unit to use.
#[derive(Clone, Copy)]
pub(crate) struct Level(Arch);

impl fmt::Debug for Level {
    /// The name alone: `pulp` would list every instruction set.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        struct Lanes;
        impl WithSimd for Lanes {
            type Output = usize;
            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> usize {
                S::F64_LANES
            }
        }
        write!(f, "{} lanes of f64", self.run(Lanes))
    }
}

impl Level {
    /// The best that this processor has.
    pub(crate) fn best() -> Self {
        Self(Arch::new())
    }

    /// Runs `operation`, compiled for this level.
    #[inline]
    pub(crate) fn run<O: WithSimd>(self, operation: O) -> O::Output {
        self.0.dispatch(operation)
    }

    /// Every level that this processor has, the one-lane level first.
    #[cfg(test)]
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self(Arch::Scalar)];
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            all.extend(V3::try_new().map(|simd| Self(Arch::V3(simd))));
            all.extend(V4::try_new().map(|simd| Self(Arch::V4(simd))));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(pulp::aarch64::Neon::try_new().map(|simd| Self(Arch::Neon(simd))));
        all
    }

    /// Whether multiply-add is fused: such levels give the same bits.
    #[cfg(test)]
    pub(crate) fn is_fused(self) -> bool {
        !matches!(self.0, Arch::Scalar)
    }
}
