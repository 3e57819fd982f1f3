//! What no sum of many rows may cost.

use super::*;
use ndarray::{Array1, Array2, Axis, array, s};
use proptest::prelude::*;

/// Whole numbers with a fraction that a double has room for: their sums are exact.
fn offset(base: f64, rows: usize) -> Array2<f64> {
    Array2::from_shape_fn((rows, 1), |(row, _)| {
        base + f64::from((row % 7) as u8) / 64.0
    })
}

fn measured<A: Scalar>(x: &Array2<A>) -> (f64, f64) {
    let moments = Moments::of(x.view(), None);
    let deviation = moments.deviations().next().unwrap();
    (moments.columns()[0].mean(), deviation)
}

#[test]
fn a_million_equal_values_have_their_value_for_mean_and_no_deviation() {
    for value in [0.1, 273.15, -1e-300, 1e300, 5e-324] {
        let x = Array2::from_elem((1_000_000, 1), value);
        assert_eq!(measured(&x), (value, 0.0));
    }
    let x = Array2::from_elem((1_000_000, 1), 273.15_f32);
    assert_eq!(measured(&x), (f64::from(273.15_f32), 0.0));
}

#[test]
fn a_million_rows_cost_no_digits() {
    // 7 divides the number of rows: the values 0 to 6 are equally frequent, their mean is 3 and
    // their variance 4.
    let rows = 7 * 142_857;
    for base in [0.0, 1.0, 1e6, 1e12] {
        let (mean, deviation) = measured(&offset(base, rows));
        assert_eq!(mean, base + 3.0 / 64.0);
        approx::assert_relative_eq!(deviation, 2.0 / 64.0, max_relative = 4.0 * f64::EPSILON);
    }
    // Eighths at 1e6 are exact in f32.
    let x = Array2::from_shape_fn((rows, 1), |(row, _)| {
        1e6_f32 + f32::from((row % 7) as u8) / 8.0
    });
    let (mean, deviation) = measured(&x);
    assert_eq!(mean, 1e6 + 3.0 / 8.0);
    approx::assert_relative_eq!(deviation, 2.0 / 8.0, max_relative = 4.0 * f64::EPSILON);
}

#[test]
fn values_of_any_size_stay_in_range() {
    let x = array![[1.0], [2.0], [6.0], [-3.0]];
    let (mean, deviation) = measured(&x);
    for size in [1e-320, 1e-300, 1e-150, 1e150, 1e300, 1e307] {
        let (scaled_mean, scaled_deviation) = measured(&(&x * size));
        // A subnormal has few digits.
        let digits = if size < 1e-307 { 1e-2 } else { 1e-14 };
        approx::assert_relative_eq!(scaled_mean / size, mean, max_relative = digits);
        approx::assert_relative_eq!(scaled_deviation / size, deviation, max_relative = digits);
    }
}

#[test]
fn constants_and_two_values_are_known_by_their_values() {
    let x = array![
        [0.1, 1.0, 0.0, 1.0],
        [0.1, 1.0 + f64::EPSILON, 5.0, 2.0],
        [0.1, 1.0, 0.0, 3.0]
    ];
    let moments = Moments::of(x.view(), None);
    let columns = moments.columns();
    let constant = [true, false, false, false];
    let two_valued = [false, true, true, false];
    for (column, (constant, two_valued)) in columns.iter().zip(constant.into_iter().zip(two_valued))
    {
        assert_eq!(column.is_constant(), constant);
        assert_eq!(column.is_two_valued(), two_valued);
    }
    assert_eq!(columns[2].half_range(), 2.5);
    assert!(moments.deviations().skip(1).all(|d| d > 0.0));
}

#[test]
fn sums_keep_what_a_running_sum_loses() {
    let terms = || std::iter::once(1e16).chain(std::iter::repeat_n(1.0, 1000));
    assert_eq!(sum(terms()), 1e16 + 1000.0);
    assert_eq!(sum([1e300, 1.0, -1e300]), 1.0);
}

#[test]
fn row_by_row_is_as_exact_as_all_at_once() {
    let x = offset(273.15, 70_000);
    let mut moments = Moments::new(1);
    for row in x.axis_chunks_iter(Axis(0), 1) {
        moments.merge(&Moments::of(row, None));
    }
    let (mean, deviation) = measured(&x);
    let found = moments.deviations().next().unwrap();
    approx::assert_relative_eq!(
        moments.columns()[0].mean(),
        mean,
        max_relative = f64::EPSILON
    );
    approx::assert_relative_eq!(found, deviation, max_relative = 1e-14);
    assert_eq!(moments.rows(), 70_000);
}

#[test]
fn equal_blocks_of_different_values_are_no_constant() {
    let mut moments = Moments::of(array![[2.0], [2.0]].view(), None);
    assert!(moments.columns()[0].is_constant());
    moments.merge(&Moments::of(array![[4.0], [4.0]].view(), None));
    let column = moments.columns()[0];
    assert!(column.is_two_valued());
    assert_eq!(
        (column.mean(), moments.deviations().next()),
        (3.0, Some(1.0))
    );
    moments.merge(&Moments::of(array![[3.0]].view(), None));
    assert!(!moments.columns()[0].is_two_valued());
}

proptest! {
    #[test]
    fn pooled_moments_are_those_of_all_rows(
        values in proptest::collection::vec(
            (prop_oneof![Just(0.0), -1e3..1e3_f64, -1e-3..1e-3_f64], 0.0..3.0_f64), 2..60),
        cut in 0.0..1.0_f64,
        power in -200..200_i32,
    ) {
        let size = 10.0_f64.powi(power);
        let x: Array1<f64> = values.iter().map(|(x, _)| x * size).collect();
        let x = x.insert_axis(Axis(1));
        let weight = |&(_, w): &(f64, f64)| if w < 0.5 { 0.0 } else { w };
        let w: Array1<f64> = values.iter().map(weight).collect();
        let cut = (cut * values.len() as f64) as usize;
        let part = |range: std::ops::Range<usize>, factor: f64| {
            let w = &w.slice(s![range.clone()]) * factor;
            Moments::of(x.slice(s![range, ..]), Some(w.view()))
        };
        let all = part(0..values.len(), 1.0);
        let mut pooled = part(0..cut, 1.0);
        pooled.merge(&part(cut..values.len(), 1.0));
        prop_assert!(pooled.is_sound() && all.is_sound());
        prop_assert_eq!(pooled.rows(), all.rows());
        if all.rows() == 0 {
            return Ok(());
        }
        let (one, other) = (all.columns()[0], pooled.columns()[0]);
        prop_assert_eq!(one.is_constant(), other.is_constant());
        prop_assert_eq!(one.is_two_valued(), other.is_two_valued());
        let largest = x.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let bound = 1e-14 * largest;
        prop_assert!((one.mean() - other.mean()).abs() <= bound);
        let (a, b) = (all.deviations().next().unwrap(), pooled.deviations().next().unwrap());
        prop_assert!((a - b).abs() <= 1e-13 * a, "{} {}", a, b);
        // A factor of all weights says nothing.
        let tripled = part(0..values.len(), 3.0).deviations().next().unwrap();
        prop_assert!((a - tripled).abs() <= 1e-13 * a);
    }
}
