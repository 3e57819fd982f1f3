//! What holds for all models, and values worked out by hand.

use super::*;
use crate::geometry::Angles;
use approx::assert_relative_eq;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, FRAC_PI_6};

type Model = fn(&DirectionPair) -> f64;

/// White surfaces, with the most that one may return.
const WHITE: [(&str, Model, f64); 11] = [
    ("lambert", |d| lambert(d, 1.0), 1.0),
    ("oren_nayar 0.2", |d| oren_nayar(d, 1.0, 0.2), 1.015),
    ("oren_nayar 0.8", |d| oren_nayar(d, 1.0, 0.8), 1.0),
    ("ward 0.1", |d| ward(d, 1.0, 0.1), 1.0),
    ("ward 0.3", |d| ward(d, 1.0, 0.3), 1.0),
    ("ward 0.8", |d| ward(d, 1.0, 0.8), 1.0),
    ("ggx 0.1", |d| ggx(d, 1.0, 0.1), 1.0),
    ("ggx 0.3", |d| ggx(d, 1.0, 0.3), 1.0),
    ("ggx 1", |d| ggx(d, 1.0, 1.0), 1.0),
    (
        "ward with a direction",
        |d| anisotropic_ward(d, 1.0, [0.1, 0.4], FRAC_PI_2),
        1.0,
    ),
    (
        "ggx with a direction",
        |d| anisotropic_ggx(d, 1.0, [0.1, 0.4], 0.0),
        1.0,
    ),
];

/// The share of light from `theta_i` that is reflected, by the midpoint rule in
/// sin^2(theta_o) and azimuth, whose measure is cos(theta_o) d omega_o.
fn albedo(model: Model, theta_i: f64) -> f64 {
    let steps = 600;
    let mut sum = 0.0;
    for row in 0..steps {
        let theta_o = ((f64::from(row) + 0.5) / f64::from(steps)).sqrt().asin();
        for column in 0..steps {
            let phi_o = (f64::from(column) + 0.5) / f64::from(steps) * PI;
            sum += model(&DirectionPair::from(Angles {
                theta_i,
                phi_i: 0.0,
                theta_o,
                phi_o,
            }));
        }
    }
    sum * PI / f64::from(steps * steps)
}

#[test]
fn white_surfaces_return_no_more_light_than_they_receive() {
    for (name, model, most) in WHITE {
        for theta_i in [0.0, 0.5, 1.0, 1.3, 1.5] {
            let albedo = albedo(model, theta_i);
            assert!(
                albedo <= most + 1e-3 && albedo > 0.0,
                "{name} at {theta_i}: {albedo}"
            );
        }
    }
}

#[test]
fn smooth_lobes_return_all_light_that_comes_head_on() {
    // No shadowing and no loss below the horizon at normal incidence, in the narrow limit.
    assert_relative_eq!(albedo(|d| ward(d, 1.0, 0.1), 0.0), 1.0, epsilon = 0.02);
    assert_relative_eq!(albedo(|d| ggx(d, 1.0, 0.1), 0.0), 1.0, epsilon = 0.02);
}

#[test]
fn a_smooth_diffuse_surface_is_lamberts() {
    let pair = DirectionPair::from(Angles {
        theta_i: 1.0,
        phi_i: 0.2,
        theta_o: 0.4,
        phi_o: -2.0,
    });
    assert_eq!(oren_nayar(&pair, 0.7, 0.0), lambert(&pair, 0.7));
}

#[test]
fn lobes_with_a_direction_turn_with_it_and_without_one_are_the_isotropic_ones() {
    let pair = DirectionPair::from(Angles {
        theta_i: 0.9,
        phi_i: 0.4,
        theta_o: 0.6,
        phi_o: 2.8,
    });
    let alpha = [0.2, 0.5];
    for turn in [0.0, 0.7, 3.0] {
        let turned = pair.turned(turn);
        assert_relative_eq!(
            anisotropic_ggx(&turned, 0.3, alpha, turn),
            anisotropic_ggx(&pair, 0.3, alpha, 0.0),
            max_relative = 1e-12
        );
        assert_relative_eq!(
            anisotropic_ward(&turned, 0.3, alpha, turn),
            anisotropic_ward(&pair, 0.3, alpha, 0.0),
            max_relative = 1e-12
        );
        assert_relative_eq!(
            anisotropic_ggx(&pair, 0.3, [0.2; 2], turn),
            ggx(&pair, 0.3, 0.2),
            max_relative = 1e-12
        );
        assert_relative_eq!(
            anisotropic_ward(&pair, 0.3, [0.2; 2], turn),
            ward(&pair, 0.3, 0.2),
            max_relative = 1e-12
        );
    }
}

#[test]
fn head_on_values_are_those_worked_out_by_hand() {
    let pair = DirectionPair::from(Angles {
        theta_i: 0.0,
        phi_i: 0.0,
        theta_o: 0.0,
        phi_o: 0.0,
    });
    // Ward: rho / (4 pi alpha^2). GGX: D = 1 / (pi alpha^2), G = 1, F = f0.
    assert_relative_eq!(
        ward(&pair, 0.5, 0.2),
        0.5 / (4.0 * PI * 0.04),
        epsilon = 1e-12
    );
    assert_relative_eq!(
        ggx(&pair, 0.04, 0.2),
        0.04 / (4.0 * PI * 0.04),
        epsilon = 1e-12
    );
    // sigma = 0.3: A = 1 - 0.045 / 0.42.
    let expected = (1.0 - 0.045 / 0.42) / PI;
    assert_relative_eq!(oren_nayar(&pair, 1.0, 0.3), expected, epsilon = 1e-12);
}

#[test]
fn there_is_no_reflection_at_or_below_the_horizon() {
    for theta in [FRAC_PI_2 + 1e-9, 2.0, f64::NAN] {
        let pair = DirectionPair::from(Angles {
            theta_i: theta,
            phi_i: 0.0,
            theta_o: 0.3,
            phi_o: 0.0,
        });
        for (name, model, _) in WHITE {
            assert_eq!(model(&pair), 0.0, "{name}");
            assert_eq!(model(&pair.swapped()), 0.0, "{name}");
        }
    }
}

#[test]
fn lobes_of_cosines_at_hand_computed_directions() {
    // Light at 60 degrees, viewer at 30 on the other side and on the same: 30 degrees from
    // the mirror direction in the first case, 90 in the second; half vector at 15 and 45.
    let pair = |phi_o: f64| {
        DirectionPair::from(Angles {
            theta_i: FRAC_PI_3,
            phi_i: 0.3,
            theta_o: FRAC_PI_6,
            phi_o: 0.3 + phi_o,
        })
    };
    let (forward, back) = (pair(PI), pair(0.0));
    assert_relative_eq!(
        phong(&forward, 0.1, 2.0, 4.0),
        0.1 + 4.0 * 0.5625,
        epsilon = 1e-14
    );
    assert_relative_eq!(phong(&back, 0.1, 2.0, 4.0), 0.1, epsilon = 1e-14);
    assert_relative_eq!(
        blinn_phong(&back, 0.1, 2.0, 4.0),
        0.1 + 4.0 * 0.25,
        epsilon = 1e-14
    );
    // cos^2 15 degrees = (2 + sqrt 3) / 4.
    let cos2 = (2.0 + 3.0_f64.sqrt()) / 4.0;
    let expected = 4.0 * cos2 * cos2;
    assert_relative_eq!(
        blinn_phong(&forward, 0.0, 2.0, 4.0),
        expected,
        epsilon = 1e-14
    );
    // psi = -pi/4 is R.V; psi = pi/4 is L.V, here cos 30; psi = 0 cos_i cos_o = sqrt(3) / 4.
    let mirror = lafortune(&forward, 2.0, -FRAC_PI_4, 4.0);
    assert_relative_eq!(mirror, 2.0 * 0.5625, epsilon = 1e-14);
    let retro = lafortune(&back, 2.0, FRAC_PI_4, 2.0);
    assert_relative_eq!(retro, 2.0 * 0.75, epsilon = 1e-14);
    let normal = lafortune(&back, 1.0, 0.0, 2.0);
    assert_relative_eq!(normal, 2.0 * 3.0 / 16.0, epsilon = 1e-14);
}

proptest! {
    #[test]
    fn lobes_of_cosines_are_finite_and_not_negative(
        theta_i in 0.0..FRAC_PI_2, phi_o in -PI..PI, theta_o in 0.0..FRAC_PI_2,
        direction in -FRAC_PI_2..FRAC_PI_2, exponent in 0.1..200.0_f64,
    ) {
        let pair = DirectionPair::from(Angles { theta_i, phi_i: 0.0, theta_o, phi_o });
        let values = [
            phong(&pair, 0.1, 1.0, exponent),
            blinn_phong(&pair, 0.1, 1.0, exponent),
            lafortune(&pair, 1.0, direction, exponent),
        ];
        prop_assert!(values.iter().all(|v| v.is_finite() && *v >= 0.0), "{:?}", values);
        // The base of the power is a sum of three products of cosines, each rounded to about epsilon, so
        // its error is absolute; the power multiplies it by up to exponent / base.
        let swapped = lafortune(&pair.swapped(), 1.0, direction, exponent);
        let base = |lobe: f64| lobe.powf(exponent.recip());
        let denormal = swapped.max(values[2]) < 1e-300;
        prop_assert!(denormal || (base(swapped) - base(values[2])).abs() <= 32.0 * f64::EPSILON);
    }

    #[test]
    fn models_are_reciprocal_finite_and_not_negative(
        theta_i in 0.0..FRAC_PI_2, phi_i in -PI..PI,
        theta_o in 0.0..FRAC_PI_2, phi_o in -PI..PI,
    ) {
        let pair = DirectionPair::from(Angles { theta_i, phi_i, theta_o, phi_o });
        for (name, model, _) in WHITE {
            let (value, swapped) = (model(&pair), model(&pair.swapped()));
            prop_assert!(value.is_finite() && value >= 0.0, "{}: {}", name, value);
            prop_assert!((value - swapped).abs() <= 1e-9 * value, "{name}");
        }
    }
}
