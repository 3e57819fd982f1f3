//! Targets and values, there and back.

use super::*;
use approx::{assert_abs_diff_eq, assert_relative_eq};
use ndarray::array;
use proptest::prelude::*;

const TRANSFORMS: [TargetTransform; 3] = [
    TargetTransform::Identity,
    TargetTransform::Log { offset: 0.5 },
    TargetTransform::CubeRoot,
];

#[test]
fn targets_at_hand_computed_values() {
    // Medians 2 (of 1, 2, 4; the 0 does not count) and 20.
    let values = array![
        [0.0, 10.0],
        [1.0, 10.0],
        [2.0, 20.0],
        [4.0, 40.0],
        [0.0, 40.0]
    ];
    let log = TargetTransform::Log { offset: 0.5 }
        .fit(values.view())
        .unwrap();
    let targets = log.to_targets(values.view()).unwrap();
    assert_abs_diff_eq!(
        targets.column(0),
        array![0.0, 2.0_f64.ln(), 3.0_f64.ln(), 5.0_f64.ln(), 0.0].view(),
        epsilon = 1e-15
    );
    assert_abs_diff_eq!(targets[[3, 1]], 5.0_f64.ln(), epsilon = 1e-15);

    let cube = TargetTransform::CubeRoot.fit(values.view()).unwrap();
    let targets = cube.to_targets(array![[8.0, 0.027]].view()).unwrap();
    assert_abs_diff_eq!(targets, array![[2.0, 0.3]], epsilon = 1e-15);
}

#[test]
fn no_target_gives_a_negative_or_unbounded_value() {
    let values = array![[0.0], [1.0], [3.0]];
    for transform in [TargetTransform::default_log(), TargetTransform::CubeRoot] {
        let fitted = transform.fit(values.view()).unwrap();
        let targets = array![[-1e300], [-1.0], [0.0], [1e9], [f64::INFINITY]];
        let back = fitted.to_values(targets).unwrap();
        let most = 3.0 * TargetTransform::HEADROOM;
        let expected = array![[0.0], [0.0], [0.0], [most], [most]];
        assert_eq!(back, expected, "{transform}");
    }
}

#[test]
fn an_all_black_channel_stays_black() {
    let values = Array2::zeros((4, 1));
    for transform in TRANSFORMS {
        let fitted = transform.fit(values.view()).unwrap();
        let targets = fitted.to_targets(values.view()).unwrap();
        assert_eq!(fitted.to_values(targets).unwrap(), values, "{transform}");
    }
}

#[test]
fn the_log_resolves_a_metallic_paint_from_one_in_a_hundred_thousand_to_six_hundred() {
    // Nine of ten values at 0.05 as a paint has, then extremes.
    let mut values = Array2::from_elem((40, 1), 0.05);
    values[[0, 0]] = 1e-5;
    values[[1, 0]] = 600.0;
    let fitted = TargetTransform::default_log().fit(values.view()).unwrap();
    let targets = fitted.to_targets(values.view()).unwrap();
    let back = fitted.to_values(targets.clone()).unwrap();
    for (&value, &back) in values.iter().zip(&back) {
        // A relative rounding of the target t = ln(1 + f/o) moves f by t (f + o) / f of
        // them: 1 where f is far below o, and t <= ln(600 / 0.005) = 11.7 far above.
        assert_relative_eq!(value, back, max_relative = 12.0 * f64::EPSILON);
    }
    // Errors of the target are relative errors of the large value.
    let moved = fitted.to_values(targets + 1e-3).unwrap();
    assert_relative_eq!(moved[[1, 0]] / 600.0, 1e-3_f64.exp(), max_relative = 1e-5);
}

#[test]
fn wrong_settings_and_shapes_are_refused() {
    let values = array![[1.0, 2.0]];
    for offset in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(TargetTransform::Log { offset }.fit(values.view()).is_err());
    }
    let fitted = TargetTransform::CubeRoot.fit(values.view()).unwrap();
    assert!(fitted.to_targets(array![[1.0]].view()).is_err());
    assert!(fitted.to_values(array![[1.0]]).is_err());
}

#[test]
fn names_are_read_back() {
    for name in TargetTransform::NAMES {
        assert_eq!(name.parse::<TargetTransform>().unwrap().name(), name);
    }
    assert!("square".parse::<TargetTransform>().is_err());
}

proptest! {
    #[test]
    fn values_survive_the_way_there_and_back(
        values in proptest::collection::vec(
            prop_oneof![Just(0.0), 1e-6..1.0_f64, 1.0..1e4_f64], 1..30),
    ) {
        let values = Array2::from_shape_vec((values.len(), 1), values).unwrap();
        for transform in TRANSFORMS {
            let fitted = transform.fit(values.view()).unwrap();
            let back = fitted.to_values(fitted.to_targets(values.view()).unwrap()).unwrap();
            for (&value, &back) in values.iter().zip(&back) {
                // ln(1 + f/o) stays below 25 here: 25 roundings of the target.
                prop_assert!((value - back).abs() <= 30.0 * f64::EPSILON * value, "{}", transform);
            }
        }
    }

    #[test]
    fn links_are_monotonic(low in 0.0..10.0_f64, step in 1e-3..10.0_f64, median in 1e-3..1e3_f64) {
        let fitted_to = array![[median]];
        for transform in TRANSFORMS {
            let fitted = transform.fit(fitted_to.view()).unwrap();
            let targets = fitted.to_targets(array![[low], [low + step]].view()).unwrap();
            prop_assert!(targets[[0, 0]] < targets[[1, 0]], "{}", transform);
        }
    }
}
