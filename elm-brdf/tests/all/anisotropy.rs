//! Surfaces with a grain: detected, fitted with inputs that turn with them, rendered, exported.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::support::Program;
use elm_brdf::Error;
use elm_brdf::albedo;
use elm_brdf::batch::Packed;
use elm_brdf::export::{ExportError, merl};
use elm_brdf::features::Features;
use elm_brdf::model::{BrdfModel, Tuned};
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::{Angles, Brdf, lobes};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Brushed metal, its grain at half a radian from x.
fn brushed(pair: &DirectionPair) -> f64 {
    0.05 / PI + lobes::anisotropic_ggx(pair, 0.8, [0.12, 0.45], 0.5)
}

fn plastic(pair: &DirectionPair) -> f64 {
    0.2 / PI + lobes::ggx(pair, 0.05, 0.25)
}

/// Half of them anywhere, half near the mirror direction.
fn scattered(count: usize, seed: u64) -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut number = |most: f64| random.random_range(0.0..most);
    (0..count)
        .map(|row| {
            let (theta, phi) = (number(1.3), number(2.0 * PI));
            let outgoing = if row % 2 == 0 {
                cartesian(number(1.3), number(2.0 * PI))
            } else {
                let aside = 0.6 * (number(1.0) - 0.5);
                cartesian(
                    (theta + 0.6 * (number(1.0) - 0.5)).clamp(0.0, 1.4),
                    phi + PI + aside,
                )
            };
            DirectionPair {
                incident: cartesian(theta, phi),
                outgoing,
            }
        })
        .collect()
}

/// Values with a per cent of noise.
fn measured(pairs: &[DirectionPair], formula: fn(&DirectionPair) -> f64) -> Array2<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let noise: Vec<f64> = pairs
        .iter()
        .map(|_| 1.0 + 0.01 * (random.random_range(-1.7..1.7)))
        .collect();
    Array2::from_shape_fn((pairs.len(), 1), |(row, _)| {
        formula(&pairs[row]) * noise[row]
    })
}

fn log_error(model: &dyn Brdf, formula: fn(&DirectionPair) -> f64) -> f64 {
    let pairs = scattered(1000, 77);
    let values = model.eval(&pairs).unwrap();
    let errors = pairs.iter().zip(&values).map(|(pair, value)| {
        let truth = formula(pair);
        ((value + 0.01) / (truth + 0.01)).ln().abs()
    });
    errors.sum::<f64>() / 1000.0
}

fn fitted(
    rows: usize,
    formula: fn(&DirectionPair) -> f64,
    features: Option<Features>,
) -> BrdfModel {
    let pairs = scattered(rows, 1);
    let tuned = Tuned {
        features,
        ..Tuned::default()
    };
    tuned
        .fit_model(&pairs, measured(&pairs, formula).view())
        .unwrap()
}

#[test]
fn a_grain_at_any_angle_is_found_by_few_and_many_measurements_and_not_where_there_is_none() {
    for rows in [400, 3000] {
        let model = fitted(rows, brushed, None);
        assert!(!model.is_isotropic(), "{rows} rows: {}", model.features());
        let blind = fitted(rows, brushed, Some(Features::Highlight));
        let (found, without) = (log_error(&model, brushed), log_error(&blind, brushed));
        assert!(
            found < 0.25 * without,
            "{rows} rows: {found}, without {without}"
        );

        let model = fitted(rows, plastic, None);
        assert!(model.is_isotropic(), "{rows} rows: {}", model.features());
    }
}

#[test]
fn light_from_one_side_cannot_tell_a_grain() {
    let pairs: Vec<DirectionPair> = scattered(300, 1)
        .iter()
        .map(|pair| pair.turned(-pair.incident[1].atan2(pair.incident[0])))
        .collect();
    let values = measured(&pairs, brushed);
    let model = Tuned::default().fit_model(&pairs, values.view()).unwrap();
    assert!(model.is_isotropic());
}

#[test]
fn a_model_with_a_grain_is_the_same_packed_after_half_a_turn_and_from_a_file() {
    let model = fitted(400, brushed, None);
    let pairs = scattered(200, 5);
    let values = model.eval(&pairs).unwrap();
    let half: Vec<DirectionPair> = pairs.iter().map(|pair| pair.turned(PI)).collect();
    // The root of an angle by rounding; see the inputs' own test.
    for (value, other) in values.iter().zip(&model.eval(&half).unwrap()) {
        assert!(
            (value - other).abs() <= 1e-6 * value.abs() + 1e-9,
            "{value} {other}"
        );
    }
    let packed = Packed::<f64>::new(&model).unwrap();
    assert!(!packed.is_isotropic());
    for (value, other) in values.iter().zip(&packed.eval(&pairs).unwrap()) {
        assert!(
            (value - other).abs() <= 1e-6 * value.abs() + 1e-9,
            "{value} {other}"
        );
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("brushed.elm");
    model.save(&path).unwrap();
    let read: BrdfModel = BrdfModel::load(&path).unwrap();
    assert_eq!(read.eval(&pairs).unwrap(), values);

    let quarter = albedo::directional(&model, 0.7).unwrap()[0];
    assert!(quarter < 1.0, "{quarter}");
    assert!(matches!(
        merl(&model),
        Err(Error::Export(ExportError::Anisotropic))
    ));
}

fn failure(program: &Program, arguments: &[&str]) -> String {
    let assert = program.command().args(arguments).assert().failure();
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

fn table(path: &Path, formula: fn(&DirectionPair) -> f64) {
    let pairs = scattered(400, 1);
    let values = measured(&pairs, formula);
    let mut text = String::from("theta_i,phi_i,theta_o,phi_o,brdf\n");
    for (pair, value) in pairs.iter().zip(&values) {
        let d = Angles::of(pair);
        writeln!(
            text,
            "{},{},{},{},{value}",
            d.theta_i, d.phi_i, d.theta_o, d.phi_o
        )
        .unwrap();
    }
    fs::write(path, text).unwrap();
}

#[test]
fn the_command_line_says_that_there_is_a_grain_and_which_formats_cannot_hold_one() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    table(&dir.path().join("brushed.csv"), brushed);
    table(&dir.path().join("plastic.csv"), plastic);
    let said = program.output(&["fit", &path("brushed.csv"), "-o", &path("m.elm")]);
    assert!(said.contains("the surface has a grain"), "{said}");
    let said = program.output(&["fit", &path("plastic.csv"), "-o", &path("p.elm")]);
    assert!(!said.contains("grain"), "{said}");

    program.output(&["export", &path("m.elm"), "-o", &path("m.glsl")]);
    let shader = fs::read_to_string(dir.path().join("m.glsl")).unwrap();
    assert!(shader.contains("+x is the surface's tangent"), "{shader}");
    let refused = failure(
        &program,
        &["export", &path("m.elm"), "-o", &path("m.binary")],
    );
    assert!(
        refused.contains("MERL") && refused.contains("grain"),
        "{refused}"
    );
    assert!(!dir.path().join("m.binary").exists());
}

#[test]
fn a_grain_lies_along_the_tangent_and_is_turned_by_rotation() {
    let program = Program::new();
    let dir = tempfile::tempdir().unwrap();
    fitted(400, brushed, None)
        .save(dir.path().join("m.elm"))
        .unwrap();
    let picture = |name: &str, square: &str, rotation: f64| {
        let scene = format!(
            "
[image]
width = 24
height = 24
samples = 1
[camera]
position = [0, 0, 4]
target = [0, 0, 0]
height = 2
[material.m]
model = 'm.elm'
rotation = {rotation}
[[directional]]
towards = [0.5, 0.2, 1]
irradiance = [3, 3, 3]
[[rectangle]]
{square}
material = 'm'
"
        );
        let file = dir.path().join(format!("{name}.toml"));
        fs::write(&file, scene).unwrap();
        let out = dir.path().join(format!("{name}.png"));
        program.output(&[
            "render",
            file.to_str().unwrap(),
            "-o",
            out.to_str().unwrap(),
        ]);
        image::open(out).unwrap().to_rgb8().into_raw()
    };
    let upright = "corner = [-1, -1, 0]\nedge_u = [2, 0, 0]\nedge_v = [0, 2, 0]";
    let on_its_side = "corner = [1, -1, 0]\nedge_u = [0, 2, 0]\nedge_v = [-2, 0, 0]";
    let turned = picture("turned", upright, 90.0);
    assert_eq!(turned, picture("side", on_its_side, 0.0));
    assert_eq!(
        turned,
        picture("half", upright, FRAC_PI_2.to_degrees() + 180.0)
    );
    assert_ne!(turned, picture("as_it_is", upright, 0.0));
    let scene = dir.path().join("bad.toml");
    let good = fs::read_to_string(dir.path().join("turned.toml")).unwrap();
    fs::write(&scene, good.replace("rotation = 90", "rotation = nan")).unwrap();
    let out = dir.path().join("bad.png");
    let said = failure(
        &program,
        &[
            "render",
            scene.to_str().unwrap(),
            "-o",
            out.to_str().unwrap(),
        ],
    );
    assert!(
        said.contains("rotation = NaN, expected a number of degrees"),
        "{said}"
    );
}
