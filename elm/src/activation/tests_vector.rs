//! The vector code against independent references: `f32` against the standard library's `f64`,
//! `f64` against arithmetic with 40 digits; on every vector unit that the machine has.

use astro_float::{BigFloat, Consts, RoundingMode, Sign};

use super::{Accuracy, Activation};
use crate::scalar::Scalar;
use crate::simd::Level;

const DIGITS: usize = 192;
const ROUND: RoundingMode = RoundingMode::ToEven;

/// What `Accuracy::Full` states, in units in the last place.
const FULL_ULP: f64 = 5.0;
/// What `Accuracy::Fast` states, absolute.
const FAST_ERROR: f64 = 6e-7;

/// The built-in functions whose values are rounded at all: unless they are named here, all.
fn rounded<A: Scalar>() -> Vec<Activation<A>> {
    use Activation::{HardLimit, Linear, Relu, SquaredRelu};
    let all = Activation::BUILT_IN.into_iter();
    all.filter(|f| !matches!(f, Relu | SquaredRelu | HardLimit | Linear))
        .collect()
}

/// Every sign, zeros, subnormals, both ends of every binade, limits of the formulas, NaN.
fn special_arguments() -> Vec<f64> {
    let mut all = vec![
        0.0,
        f64::INFINITY,
        f64::NAN,
        f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
    ];
    all.extend([
        0.5, 1.0, 8.0, 10.0, 11.0, 20.0, 27.4, 105.0, 745.2, 746.0, 1e5, 1e6, 1e10,
    ]);
    // Multiples of pi, where a sine cancels.
    all.extend((1..40).map(|k| f64::from(k) * std::f64::consts::PI));
    all.extend([103_993.0 / 33_102.0 * 33_102.0, 355.0, 710.0, 312_689.0]);
    for exponent in -1074..=1023 {
        let power = 2.0_f64.powi(exponent);
        all.extend([power, power.next_up(), power.next_down()]);
    }
    let negative: Vec<_> = all.iter().map(|z| -z).collect();
    all.extend(negative);
    all
}

/// About `count` arguments, spread evenly over the exponents from 2^-30 to 2^25 and within them.
fn spread_arguments(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| {
        // Weyl sequences: evenly spread, and the same in every run.
        let exponent = (f64::from(i) * 0.618_033_988_749_894_9).fract() * 55.0 - 30.0;
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        sign * exponent.exp2()
    })
}

/// Value of `function` at `z`, computed with about 57 digits, as an `f64` and the remainder.
fn reference(function: &Activation<f64>, z: f64, consts: &mut Consts) -> (f64, f64) {
    let big = |v: f64| BigFloat::from_f64(v, DIGITS);
    let one = big(1.0);
    let x = big(z);
    let exp = |v: &BigFloat, consts: &mut Consts| v.exp(DIGITS, ROUND, consts);
    let value = match function {
        Activation::Sigmoid => {
            let e = exp(&x.neg(), consts);
            one.div(&one.add(&e, DIGITS, ROUND), DIGITS, ROUND)
        }
        Activation::Tanh => x.tanh(DIGITS, ROUND, consts),
        Activation::Sine => x.sin(DIGITS, ROUND, consts),
        Activation::Gaussian => exp(&x.mul(&x, DIGITS, ROUND).neg(), consts),
        Activation::Isru => {
            let square = one.add(&x.mul(&x, 2 * DIGITS, ROUND), 2 * DIGITS, ROUND);
            x.div(&square.sqrt(DIGITS, ROUND), DIGITS, ROUND)
        }
        other => panic!("{other} has no reference, or is exact"),
    };
    let high = to_f64(&value);
    if high.abs() < f64::MIN_POSITIVE {
        return (high, 0.0);
    }
    let low = to_f64(&value.sub(&big(high), DIGITS, ROUND));
    (high, low)
}

/// The first 53 bits, cut off; what is below the subnormals is 0.
fn to_f64(value: &BigFloat) -> f64 {
    let Some((words, _, sign, exponent, _)) = value.as_raw_parts() else {
        return f64::NAN;
    };
    let Some(&top) = words.last() else {
        return 0.0;
    };
    // The value is 0.words times 2^exponent. Two factors, because 2^exponent may be subnormal.
    let mantissa = (top >> 11) as f64;
    let power = exponent - 53;
    let magnitude = if power < -1000 {
        mantissa * 2.0_f64.powi(power + 300) * 2.0_f64.powi(-300)
    } else {
        mantissa * 2.0_f64.powi(power)
    };
    if sign == Sign::Neg {
        -magnitude
    } else {
        magnitude
    }
}

/// The distance of neighbouring values of a type with `digits` binary digits near `value`.
fn ulp(value: f64, digits: i32, least_exponent: i32) -> f64 {
    let exponent = if value == 0.0 {
        least_exponent
    } else {
        (value.abs().log2().floor() as i32).max(least_exponent)
    };
    2.0_f64.powi(exponent) * 2.0_f64.powi(1 - digits)
}

fn by_vector<A: Scalar>(
    level: Level,
    function: &Activation<A>,
    accuracy: Accuracy,
    arguments: &[A],
) -> Vec<A> {
    let mut values = arguments.to_vec();
    function.apply_to_slice(level, accuracy, &mut values);
    values
}

/// Largest error in ulp and largest absolute error, with their arguments, over `f32` arguments.
fn errors_of_single(
    level: Level,
    function: &Activation<f32>,
    accuracy: Accuracy,
    arguments: &[f32],
) -> [(f64, f32); 2] {
    let exact: Activation<f64> = function.name().parse().unwrap();
    let values = by_vector(level, function, accuracy, arguments);
    let mut worst = [(0.0, 0.0); 2];
    for (&z, &value) in arguments.iter().zip(&values) {
        let expected = exact.apply(f64::from(z));
        if expected.is_nan() {
            assert!(value.is_nan(), "{function} of {z:e} is {value:e}");
            continue;
        }
        let error = (f64::from(value) - expected).abs();
        assert!(error.is_finite(), "{function} of {z:e} is {value:e}");
        let in_ulp = error / ulp(expected, 24, -126);
        for (worst, error) in worst.iter_mut().zip([in_ulp, error]) {
            if error > worst.0 {
                *worst = (error, z);
            }
        }
    }
    worst
}

fn errors_of_double(
    level: Level,
    function: &Activation<f64>,
    accuracy: Accuracy,
    arguments: &[(f64, (f64, f64))],
) -> [(f64, f64); 2] {
    let z: Vec<_> = arguments.iter().map(|&(z, _)| z).collect();
    let values = by_vector(level, function, accuracy, &z);
    let mut worst = [(0.0, 0.0); 2];
    for (&(z, (high, low)), &value) in arguments.iter().zip(&values) {
        let error = ((value - high) - low).abs();
        assert!(error.is_finite(), "{function} of {z:e} is {value:e}");
        let in_ulp = error / ulp(high, 53, -1022);
        for (worst, error) in worst.iter_mut().zip([in_ulp, error]) {
            if error > worst.0 {
                *worst = (error, z);
            }
        }
    }
    worst
}

fn with_references(
    function: &Activation<f64>,
    arguments: impl Iterator<Item = f64>,
) -> Vec<(f64, (f64, f64))> {
    let mut consts = Consts::new().unwrap();
    arguments
        .filter(|z| z.is_finite())
        // Beyond, values are 0, 1/2, 1 or the argument: see
        // `tiny_and_huge_arguments_agree_with_the_standard_library`.
        .filter(|z| (1e-20..1e9).contains(&z.abs()))
        .map(|z| (z, reference(function, z, &mut consts)))
        .collect()
}

#[test]
fn single_precision_values_are_within_the_stated_ulp() {
    let arguments: Vec<_> = special_arguments()
        .into_iter()
        .chain(spread_arguments(40_000))
        .map(|z| z as f32)
        .collect();
    for level in Level::all() {
        for function in rounded() {
            let [(ulp, z), _] = errors_of_single(level, &function, Accuracy::Full, &arguments);
            assert!(ulp <= FULL_ULP, "{function} of {z:e}: {ulp} ulp, {level:?}");
            let [_, (error, z)] = errors_of_single(level, &function, Accuracy::Fast, &arguments);
            assert!(
                error <= FAST_ERROR,
                "{function} of {z:e}: {error:e}, {level:?}"
            );
        }
    }
}

#[test]
fn double_precision_values_are_within_the_stated_ulp() {
    for function in rounded() {
        let arguments = with_references(
            &function,
            special_arguments()
                .into_iter()
                .chain(spread_arguments(1_500)),
        );
        for level in Level::all() {
            let [(ulp, z), _] = errors_of_double(level, &function, Accuracy::Full, &arguments);
            assert!(ulp <= FULL_ULP, "{function} of {z:e}: {ulp} ulp, {level:?}");
            let [_, (error, z)] = errors_of_double(level, &function, Accuracy::Fast, &arguments);
            assert!(
                error <= FAST_ERROR,
                "{function} of {z:e}: {error:e}, {level:?}"
            );
        }
    }
}

#[test]
fn tiny_and_huge_arguments_agree_with_the_standard_library() {
    let arguments: Vec<_> = special_arguments()
        .into_iter()
        .filter(|z| z.is_finite() && !(1e-20..1e9).contains(&z.abs()))
        .collect();
    for level in Level::all() {
        for function in rounded::<f64>() {
            let values = by_vector(level, &function, Accuracy::Full, &arguments);
            for (&z, value) in arguments.iter().zip(values) {
                // The standard library is within 1 unit there.
                let expected = function.apply(z);
                let bound = (FULL_ULP + 1.0) * ulp(expected, 53, -1022);
                let error = (value - expected).abs();
                assert!(error <= bound, "{function} of {z:e}: {value:e}, {level:?}");
            }
        }
    }
}

/// The figures behind the bounds: run with `--release -- --ignored --nocapture`.
#[test]
#[ignore = "a minute: every 251st f32, and 20,000 arguments per function in f64"]
#[allow(clippy::print_stdout)]
fn largest_errors() {
    for function in rounded::<f32>() {
        for level in Level::all() {
            for accuracy in [Accuracy::Full, Accuracy::Fast] {
                let mut worst = [(0.0, 0.0); 2];
                let mut bits = 0;
                while bits < u64::from(u32::MAX) {
                    let end = bits + 251 * 65_536;
                    let block: Vec<_> = (bits..end)
                        .step_by(251)
                        .map(|bits| f32::from_bits((bits % (1 << 32)) as u32))
                        .collect();
                    let found = errors_of_single(level, &function, accuracy, &block);
                    for (worst, found) in worst.iter_mut().zip(found) {
                        if found.0 > worst.0 {
                            *worst = found;
                        }
                    }
                    bits = end;
                }
                println!("f32 {function:>9} {accuracy:?} {level:?}: ulp, absolute {worst:?}");
            }
        }
    }
    for function in rounded::<f64>() {
        let arguments = with_references(
            &function,
            special_arguments()
                .into_iter()
                .chain(spread_arguments(20_000)),
        );
        for level in Level::all() {
            for accuracy in [Accuracy::Full, Accuracy::Fast] {
                let worst = errors_of_double(level, &function, accuracy, &arguments);
                println!("f64 {function:>9} {accuracy:?} {level:?}: ulp, absolute {worst:?}");
            }
        }
    }
}

#[test]
fn every_length_of_slice_gives_the_same_values() {
    let arguments: Vec<f64> = spread_arguments(40).collect();
    for level in Level::all() {
        for function in Activation::BUILT_IN {
            let whole = by_vector(level, &function, Accuracy::Full, &arguments);
            for length in 0..arguments.len() {
                let part = by_vector(level, &function, Accuracy::Full, &arguments[..length]);
                assert_eq!(part, whole[..length], "{function}, {length} values");
            }
        }
    }
}

fn bits_agree_between_fused_levels<A: Scalar>() {
    let arguments: Vec<_> = special_arguments()
        .into_iter()
        .chain(spread_arguments(5_000))
        .map(A::from_f64)
        .collect();
    for function in Activation::BUILT_IN {
        for accuracy in [Accuracy::Full, Accuracy::Fast] {
            let mut fused = Level::all()
                .into_iter()
                .filter(|level| level.is_fused())
                .map(|level| by_vector(level, &function, accuracy, &arguments));
            let Some(first) = fused.next() else {
                return;
            };
            for other in fused {
                for ((&z, a), b) in arguments.iter().zip(&first).zip(&other) {
                    let (a, b) = (a.as_f64(), b.as_f64());
                    let same = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
                    assert!(same, "{function} of {z:e}: {a:e} and {b:e}");
                }
            }
        }
    }
}

#[test]
fn levels_with_fused_multiply_add_give_the_same_bits() {
    bits_agree_between_fused_levels::<f32>();
    bits_agree_between_fused_levels::<f64>();
}

#[test]
fn signs_limits_and_nan_are_those_of_the_exact_functions() {
    for level in Level::all() {
        for function in Activation::<f64>::BUILT_IN {
            for accuracy in [Accuracy::Full, Accuracy::Fast] {
                let arguments = [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300];
                let values = by_vector(level, &function, accuracy, &arguments);
                for (&z, value) in arguments.iter().zip(values) {
                    let expected = function.apply(z);
                    if expected.is_nan() {
                        assert!(value.is_nan(), "{function} of {z} is {value}");
                    } else if expected == 0.0 && accuracy == Accuracy::Full {
                        assert_eq!(value, 0.0, "{function} of {z}");
                        assert_eq!(
                            value.is_sign_negative(),
                            expected.is_sign_negative(),
                            "{function} of {z}"
                        );
                    } else if expected.is_infinite() {
                        assert_eq!(value, expected, "{function} of {z}");
                    } else {
                        approx::assert_abs_diff_eq!(value, expected, epsilon = FAST_ERROR);
                    }
                }
            }
        }
    }
}
