//! The published networks in `nbrdf/` on the materials in `rgl/`, whose README prints their errors,
//! and what is refused.

use std::fs;

use elm_brdf::baselines::Nbrdf;
use elm_brdf::metrics::Metrics;
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::{OpenOptions, open};
use elm_test_support::folder;

#[test]
#[ignore = "needs data: nbrdf, rgl"]
fn the_published_networks_have_the_errors_that_are_printed_for_them() {
    let (Some(networks), Some(rgl)) = (folder("nbrdf"), folder("rgl")) else {
        return;
    };
    for (material, printed) in [
        ("cc_iris_purple_gem", 0.0181),
        ("paper_white", 0.0057),
        ("vch_golden_yellow", 0.0142),
    ] {
        let network = Nbrdf::read(&networks.join(format!("{material}_rgb.f32"))).unwrap();
        let file = rgl.join(format!("{material}_rgb_test.csv"));
        let samples = open(&file, &OpenOptions::default()).unwrap().samples;
        let pairs = &samples.directions;
        let predicted = network.eval(pairs).unwrap();
        let metrics = Metrics::of(pairs, predicted.view(), samples.values.view()).unwrap();
        println!("{material}: {:.6}", metrics.log_cosine_mae);
        // Printed to four digits after the point.
        assert!(
            (metrics.log_cosine_mae - printed).abs() <= 0.5e-4,
            "{material}: {}",
            metrics.log_cosine_mae
        );
    }
}

/// The formulas as the format's description has them, with angles, in `f64`.
fn by_angles(w: &[f32], pair: &DirectionPair) -> [f64; 3] {
    let (i, o) = (pair.incident, pair.outgoing);
    let sum: Vec<f64> = (0..3).map(|k| i[k] + o[k]).collect();
    let theta = sum[0].hypot(sum[1]).atan2(sum[2]);
    let phi = sum[1].atan2(sum[0]);
    let turned = [
        phi.cos() * i[0] + phi.sin() * i[1],
        phi.cos() * i[1] - phi.sin() * i[0],
        i[2],
    ];
    let d = [
        theta.cos() * turned[0] - theta.sin() * turned[2],
        turned[1],
        theta.sin() * turned[0] + theta.cos() * turned[2],
    ];
    let mut x = vec![theta.sin(), 0.0, theta.cos(), d[0], d[1], d[2]];
    let mut rest = w;
    for outputs in [21, 21, 3] {
        let (matrix, after) = rest.split_at(x.len() * outputs);
        let (biases, after) = after.split_at(outputs);
        rest = after;
        let sum = |k: usize| {
            let products = x.iter().enumerate();
            let products = products.map(|(row, x)| x * f64::from(matrix[row * outputs + k]));
            f64::from(biases[k]) + products.sum::<f64>()
        };
        let rectify = |z: f64| if outputs == 3 { z } else { z.max(0.0) };
        x = (0..outputs).map(|k| rectify(sum(k))).collect();
    }
    [0, 1, 2].map(|k| x[k].exp_m1().max(0.0))
}

#[test]
fn a_network_without_angles_is_the_network_with_angles() {
    let weights: Vec<f32> = (0..Nbrdf::FLOATS)
        .map(|k| ((k as f32 * 12.9898).sin() * 43758.547).fract() * 0.6)
        .collect();
    let network = Nbrdf::new(&weights).unwrap();
    let mut directions: Vec<DirectionPair> = (0..300)
        .map(|k| {
            let k = f64::from(k);
            DirectionPair {
                incident: cartesian((0.37 * k) % 1.5, (0.9 * k) % 6.2),
                outgoing: cartesian((0.73 * k) % 1.5, (1.7 * k) % 6.2),
            }
        })
        .collect();
    // No azimuth of the half vector.
    let up = cartesian(0.0, 0.0);
    directions.push(DirectionPair {
        incident: up,
        outgoing: up,
    });
    let values = network.eval(&directions).unwrap();
    for (pair, values) in directions.iter().zip(values.rows()) {
        for (value, expected) in values.iter().zip(by_angles(&weights, pair)) {
            // Rounding a direction to 6e-8 turns a half vector whose part in the plane is no
            // shorter than 1e-2, as here, by 6e-6; the layers of weights up to 0.6 magnify that
            // by some 3 each at most.
            assert!(
                (value - expected).abs() < 1.5e-4 * (1.0 + expected),
                "{pair:?}"
            );
        }
    }
    let below = DirectionPair {
        incident: [0.0, 0.6, -0.8],
        outgoing: up,
    };
    assert!(network.eval(&[below]).unwrap().iter().all(|&v| v == 0.0));
}

#[test]
fn files_that_hold_no_network_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("weights.f32");
    let error = || Nbrdf::read(&file).unwrap_err().to_string();
    assert!(error().contains("weights.f32"), "{}", error());
    for (bytes, part) in [
        (vec![0; 2699], "2699 bytes"),
        (vec![0; 2704], "2704 bytes"),
        (Vec::new(), "0 bytes"),
        (
            [vec![0; 2696], f32::NAN.to_le_bytes().to_vec()].concat(),
            "674",
        ),
    ] {
        fs::write(&file, bytes).unwrap();
        let error = error();
        assert!(
            error.contains("weights.f32") && error.contains(part) && error.lines().count() == 1,
            "{error}"
        );
    }
    assert!(Nbrdf::read(dir.path()).is_err());
    assert!(Nbrdf::new(&[0.0; 10]).is_err());
}
