//! RGL files of materials with a grain, made from a formula.

use std::f64::consts::PI;

use crate::bsdf::Brushed;
use elm_datasets::rgl::Rgl;
use elm_datasets::{Angles, Brdf, DirectionPair, Sampling};

const BRUSHED: Brushed = Brushed {
    alpha: [0.25, 0.5],
    facet: [0.5, 1.0, 0.25],
};
const ELEVATIONS: [f64; 3] = [0.0, 0.5, 1.0];

/// Equal steps from -pi.
fn azimuths(span: f64, steps: u32) -> Vec<f64> {
    (0..=steps)
        .map(|k| -PI + span * f64::from(k) / f64::from(steps))
        .collect()
}

fn half(pair: &DirectionPair) -> [f64; 3] {
    let (i, o) = (pair.incident, pair.outgoing);
    let sum = [i[0] + o[0], i[1] + o[1], i[2] + o[2]];
    let length = sum.iter().map(|part| part * part).sum::<f64>().sqrt();
    sum.map(|part| part / length)
}

/// Pairs with light from the elevations of the files and these azimuths, the viewer not near the horizon,
/// where the shadowing is too steep for tables this coarse.
fn pairs(rows: usize, phi_i: impl Fn(usize) -> f64) -> Vec<DirectionPair> {
    let drawn = Sampling::Random { rows, seed: 3 }.directions().unwrap();
    let at = |(k, pair): (usize, DirectionPair)| Angles {
        theta_i: ELEVATIONS[k % ELEVATIONS.len()],
        phi_i: phi_i(k),
        ..Angles::of(&pair)
    };
    let angles = drawn.into_iter().enumerate().map(at);
    angles
        .filter(|angles| angles.theta_o < 1.1)
        .map(DirectionPair::from)
        .collect()
}

/// Mean relative error against the formula.
fn error(rgl: &Rgl, pairs: &[DirectionPair]) -> f64 {
    let mut sum = 0.0;
    for pair in pairs {
        let exact = BRUSHED.brdf(pair.incident, pair.outgoing, half(pair));
        for (found, facet) in rgl.at(pair).into_iter().zip(BRUSHED.facet) {
            sum += (found / (facet * exact) - 1.0).abs();
        }
    }
    sum / (3 * pairs.len()) as f64
}

#[test]
fn a_grain_comes_back_with_an_error_of_second_order_from_azimuths_of_every_symmetry() {
    for (span, steps) in [(2.0 * PI, 8), (PI, 4), (PI / 2.0, 2)] {
        let file = |coarse| {
            let azimuths = azimuths(span, steps);
            Rgl::from_bytes(&BRUSHED.file(&azimuths, &ELEVATIONS, 97, coarse)).unwrap()
        };
        // Eight azimuths all around, of which a file of a symmetry has a part.
        let at_file = pairs(1500, |k| -PI + f64::from((k / 3 % 8) as u32) * PI / 4.0);
        let [rough, middle, fine] = [5, 9, 17].map(|coarse| error(&file(coarse), &at_file));
        // Half the step, a quarter of the error, less what the tables of the shape add. A wrong factor or a
        // turn the wrong way would leave an error that does not go away.
        assert!(middle < rough / 2.5, "{span}: {rough} {middle}");
        assert!(fine < middle / 2.5, "{span}: {middle} {fine}");
        assert!(fine < 0.01, "{span}: {fine}");
    }
}

#[test]
fn between_its_azimuths_a_file_is_interpolated() {
    // Sixteen azimuths a turn apart; halfway between them.
    let between = pairs(600, |k| {
        -PI + (0.5 + f64::from((k / 3 % 16) as u32)) * PI / 8.0
    });
    let rgl = Rgl::from_bytes(&BRUSHED.file(&azimuths(PI, 8), &ELEVATIONS, 65, 17)).unwrap();
    let mean = error(&rgl, &between);
    assert!(mean < 0.03, "{mean}");
}

#[test]
fn images_of_a_pair_are_the_same_and_turned_ones_are_not() {
    let whole = BRUSHED.file(&azimuths(PI / 2.0, 2), &ELEVATIONS, 33, 9);
    let rgl = Rgl::from_bytes(&whole).unwrap();
    assert!(!rgl.is_isotropic());
    for pair in pairs(100, |k| 0.1 + f64::from(k as u32)) {
        let value = rgl.at(&pair)[0];
        for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]] {
            let image = |d: [f64; 3]| [x * d[0], y * d[1], d[2]];
            let image = DirectionPair {
                incident: image(pair.incident),
                outgoing: image(pair.outgoing),
            };
            assert!(
                (rgl.at(&image)[0] - value).abs() <= 1e-12 * value,
                "{pair:?}"
            );
        }
    }
    let pair = DirectionPair::from(Angles {
        theta_i: 0.5,
        phi_i: 0.0,
        theta_o: 0.2,
        phi_o: PI,
    });
    let (along, across) = (rgl.at(&pair)[1], rgl.at(&pair.turned(PI / 2.0))[1]);
    assert!((along / across - 1.0).abs() > 0.3, "{along} {across}");
    let samples = rgl
        .samples(&Sampling::Random { rows: 50, seed: 1 })
        .unwrap();
    assert_eq!(samples.values.dim(), (50, 3));
}
