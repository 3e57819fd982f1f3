//! What a formula over vector registers needs to know of `f32` and `f64`.

use pulp::Simd;

/// Values in a cache line and in the widest register: the width of a packed panel.
const LINE_BYTES: usize = 64;

macro_rules! delegate {
    ($($name:ident => $method:ident($($argument:ident),*);)*) => {
        $(#[inline(always)]
        fn $name<S: Simd>(simd: S, $($argument: Self::Register<S>),*) -> Self::Register<S> {
            simd.$method($($argument),*)
        })*
    };
}

macro_rules! declare {
    ($($name:ident($($argument:ident),*);)*) => {
        $(fn $name<S: Simd>(simd: S, $($argument: Self::Register<S>),*) -> Self::Register<S>;)*
    };
}

/// `f32` or `f64` in vector registers.
///
/// Not public: it is named by the sealed [`Scalar`](crate::Scalar) alone.
#[allow(missing_docs)]
pub trait Real: Copy + Send + Sync + 'static {
    type Register<S: Simd>: Copy;
    type Mask<S: Simd>: Copy;

    const ZERO: Self;
    const ONE: Self;
    const MINUS_ZERO: Self;
    /// Values in 64 bytes.
    const LINE: usize;
    /// Adding and subtracting this rounds to an integer.
    const ROUND: Self;
    /// Adding this to an integer $n$ puts $n$ plus the exponent's bias into the low bits of the
    /// word that [`shift_to_exponent`](Self::shift_to_exponent) shifts.
    const EXPONENT_MAGIC: Self;
    /// Adding this to an integer puts its lowest bit where
    /// [`shift_to_sign`](Self::shift_to_sign) expects it.
    const PARITY_MAGIC: Self;
    /// Splits a number into two halves of its digits.
    const SPLIT: Self;

    declare! {
        add_lanes(a, b);
        sub_lanes(a, b);
        mul_lanes(a, b);
        div_lanes(a, b);
        neg_lanes(a);
        abs_lanes(a);
        sqrt_lanes(a);
        and_lanes(a, b);
        or_lanes(a, b);
        xor_lanes(a, b);
        max_lanes(a, b);
        mul_add_lanes(a, b, c);
        neg_mul_add_lanes(a, b, c);
        fused_neg_mul_add_lanes(a, b, c);
        shift_to_exponent(a);
        shift_to_sign(a);
    }
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Register<S>;
    fn less<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Mask<S>;
    fn less_or_equal<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>)
    -> Self::Mask<S>;
    fn select<S: Simd>(
        simd: S,
        mask: Self::Mask<S>,
        a: Self::Register<S>,
        b: Self::Register<S>,
    ) -> Self::Register<S>;
    fn reduce_max<S: Simd>(simd: S, a: Self::Register<S>) -> Self;
    /// Whole registers of a slice, and the remaining entries.
    fn registers<S: Simd>(slice: &[Self]) -> (&[Self::Register<S>], &[Self]);
    /// Whole registers of a slice, and the remaining entries.
    fn registers_mut<S: Simd>(slice: &mut [Self]) -> (&mut [Self::Register<S>], &mut [Self]);
}

impl Real for f64 {
    type Register<S: Simd> = S::f64s;
    type Mask<S: Simd> = S::m64s;

    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const MINUS_ZERO: Self = -0.0;
    const LINE: usize = LINE_BYTES / size_of::<Self>();
    const ROUND: Self = 6_755_399_441_055_744.0; // 1.5 * 2^52
    // Here the unit in the last place is 2^-32: integers stand in the upper word, zeros below.
    const EXPONENT_MAGIC: Self = 1_572_864.0 + 1023.0; // 1.5 * 2^20
    const PARITY_MAGIC: Self = 1_572_864.0;
    const SPLIT: Self = 134_217_729.0; // 2^27 + 1

    delegate! {
        add_lanes => add_f64s(a, b);
        sub_lanes => sub_f64s(a, b);
        mul_lanes => mul_f64s(a, b);
        div_lanes => div_f64s(a, b);
        neg_lanes => neg_f64s(a);
        abs_lanes => abs_f64s(a);
        sqrt_lanes => sqrt_f64s(a);
        and_lanes => and_f64s(a, b);
        or_lanes => or_f64s(a, b);
        xor_lanes => xor_f64s(a, b);
        max_lanes => max_f64s(a, b);
        mul_add_lanes => mul_add_e_f64s(a, b, c);
        neg_mul_add_lanes => negate_mul_add_e_f64s(a, b, c);
        fused_neg_mul_add_lanes => negate_mul_add_f64s(a, b, c);
    }

    #[inline(always)]
    fn shift_to_exponent<S: Simd>(simd: S, a: S::f64s) -> S::f64s {
        shift_upper_words::<S, 20>(simd, a)
    }

    #[inline(always)]
    fn shift_to_sign<S: Simd>(simd: S, a: S::f64s) -> S::f64s {
        shift_upper_words::<S, 31>(simd, a)
    }

    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f64s {
        simd.splat_f64s(value)
    }

    #[inline(always)]
    fn less<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::m64s {
        simd.less_than_f64s(a, b)
    }

    #[inline(always)]
    fn less_or_equal<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::m64s {
        simd.less_than_or_equal_f64s(a, b)
    }

    #[inline(always)]
    fn select<S: Simd>(simd: S, mask: S::m64s, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.select_f64s(mask, a, b)
    }

    #[inline(always)]
    fn reduce_max<S: Simd>(simd: S, a: S::f64s) -> Self {
        simd.reduce_max_f64s(a)
    }

    #[inline(always)]
    fn registers<S: Simd>(slice: &[Self]) -> (&[S::f64s], &[Self]) {
        S::as_simd_f64s(slice)
    }

    #[inline(always)]
    fn registers_mut<S: Simd>(slice: &mut [Self]) -> (&mut [S::f64s], &mut [Self]) {
        S::as_mut_simd_f64s(slice)
    }
}

/// Shifts left the upper half of each 64-bit lane, the lower half being zero. There is no 64-bit
/// shift that every vector unit shares, but there is a 32-bit one.
#[inline(always)]
fn shift_upper_words<S: Simd, const BITS: u32>(simd: S, a: S::f64s) -> S::f64s {
    if S::IS_SCALAR {
        let bits: u64 = pulp::bytemuck::cast(a);
        return pulp::bytemuck::cast(bits << BITS);
    }
    let words: S::u32s = pulp::bytemuck::cast(a);
    pulp::bytemuck::cast(simd.wrapping_dyn_shl_u32s(words, simd.splat_u32s(BITS)))
}

impl Real for f32 {
    type Register<S: Simd> = S::f32s;
    type Mask<S: Simd> = S::m32s;

    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const MINUS_ZERO: Self = -0.0;
    const LINE: usize = LINE_BYTES / size_of::<Self>();
    const ROUND: Self = 12_582_912.0; // 1.5 * 2^23
    const EXPONENT_MAGIC: Self = 12_582_912.0 + 127.0;
    const PARITY_MAGIC: Self = 12_582_912.0;
    const SPLIT: Self = 4097.0; // 2^12 + 1

    delegate! {
        add_lanes => add_f32s(a, b);
        sub_lanes => sub_f32s(a, b);
        mul_lanes => mul_f32s(a, b);
        div_lanes => div_f32s(a, b);
        neg_lanes => neg_f32s(a);
        abs_lanes => abs_f32s(a);
        sqrt_lanes => sqrt_f32s(a);
        and_lanes => and_f32s(a, b);
        or_lanes => or_f32s(a, b);
        xor_lanes => xor_f32s(a, b);
        max_lanes => max_f32s(a, b);
        mul_add_lanes => mul_add_e_f32s(a, b, c);
        neg_mul_add_lanes => negate_mul_add_e_f32s(a, b, c);
        fused_neg_mul_add_lanes => negate_mul_add_f32s(a, b, c);
    }

    #[inline(always)]
    fn shift_to_exponent<S: Simd>(simd: S, a: S::f32s) -> S::f32s {
        shift_words::<S, 23>(simd, a)
    }

    #[inline(always)]
    fn shift_to_sign<S: Simd>(simd: S, a: S::f32s) -> S::f32s {
        shift_words::<S, 31>(simd, a)
    }

    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f32s {
        simd.splat_f32s(value)
    }

    #[inline(always)]
    fn less<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::m32s {
        simd.less_than_f32s(a, b)
    }

    #[inline(always)]
    fn less_or_equal<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::m32s {
        simd.less_than_or_equal_f32s(a, b)
    }

    #[inline(always)]
    fn select<S: Simd>(simd: S, mask: S::m32s, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.select_f32s(mask, a, b)
    }

    #[inline(always)]
    fn reduce_max<S: Simd>(simd: S, a: S::f32s) -> Self {
        simd.reduce_max_f32s(a)
    }

    #[inline(always)]
    fn registers<S: Simd>(slice: &[Self]) -> (&[S::f32s], &[Self]) {
        S::as_simd_f32s(slice)
    }

    #[inline(always)]
    fn registers_mut<S: Simd>(slice: &mut [Self]) -> (&mut [S::f32s], &mut [Self]) {
        S::as_mut_simd_f32s(slice)
    }
}

#[inline(always)]
fn shift_words<S: Simd, const BITS: u32>(simd: S, a: S::f32s) -> S::f32s {
    let words = simd.transmute_u32s_f32s(a);
    simd.transmute_f32s_u32s(simd.wrapping_dyn_shl_u32s(words, simd.splat_u32s(BITS)))
}
