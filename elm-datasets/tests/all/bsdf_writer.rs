//! Files that are written of models: read back, and held against what pbrt-v4 demands of them.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use elm_datasets::brdf::{Brdf, EvalError};
use elm_datasets::geometry::{DirectionPair, cartesian, reflect};
use elm_datasets::lobes;
use elm_datasets::rgl::{Channels, Encoded, Rgl, WriteError, encode};
use ndarray::ArrayViewMut2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A formula of some channels, each a multiple of it.
struct Model {
    channels: usize,
    is_isotropic: bool,
    formula: fn(&DirectionPair) -> f64,
}

impl Brdf for Model {
    fn channels(&self) -> usize {
        self.channels
    }

    fn is_isotropic(&self) -> bool {
        self.is_isotropic
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
            let value = (self.formula)(pair);
            for (channel, to) in row.iter_mut().enumerate() {
                *to = if pair.is_above_horizon() {
                    value * (1.0 + channel as f64) / self.channels as f64
                } else {
                    0.0
                };
            }
        }
        Ok(())
    }
}

fn isotropic(channels: usize, formula: fn(&DirectionPair) -> f64) -> Model {
    Model {
        channels,
        is_isotropic: true,
        formula,
    }
}

fn steel(channels: usize) -> Model {
    Model {
        channels,
        is_isotropic: false,
        formula: |pair| 0.05 / PI + lobes::anisotropic_ggx(pair, 0.8, [0.15, 0.45], 0.5),
    }
}

const PLASTIC: fn(&DirectionPair) -> f64 = |pair| 0.2 / PI + lobes::ggx(pair, 0.05, 0.15);

fn pairs() -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut number = |least: f64, most: f64| random.random_range(least..most);
    let mut pairs = Vec::new();
    while pairs.len() < 4000 {
        let incident = cartesian(number(0.1, 1.0).acos(), number(0.0, TAU));
        let outgoing = if pairs.len() % 2 == 0 {
            cartesian(number(0.1, 1.0).acos(), number(0.0, TAU))
        } else {
            reflect(incident, cartesian(number(0.0, 0.3), number(0.0, TAU)))
        };
        if outgoing[2] > 0.1 {
            pairs.push(DirectionPair { incident, outgoing });
        }
    }
    pairs
}

/// Mean log-cosine difference, as the writer states it.
fn difference(file: &Encoded, model: &Model) -> f64 {
    let pairs = pairs();
    let found = Rgl::from_bytes(&file.bytes).unwrap().eval(&pairs).unwrap();
    let expected = model.eval(&pairs).unwrap();
    let mut sum = 0.0;
    for ((found, expected), pair) in found.rows().into_iter().zip(expected.rows()).zip(&pairs) {
        for (&found, &expected) in found.iter().zip(expected) {
            let [found, expected] = [found, expected].map(|f| (f * pair.outgoing[2]).ln_1p());
            sum += (found - expected).abs();
        }
    }
    sum / expected.len() as f64
}

#[test]
fn files_read_back_have_the_models_values_within_the_error_that_is_stated() {
    let diffuse: fn(&DirectionPair) -> f64 = |_| 0.5 / PI;
    for formula in [PLASTIC, diffuse, |pair| lobes::oren_nayar(pair, 0.6, 0.5)] {
        let model = isotropic(3, formula);
        let file = encode(&model, &Channels::Rgb, "test", None).unwrap();
        assert!(file.log_cosine_error <= 1e-3, "{}", file.log_cosine_error);
        // Other directions, of the same distribution.
        let found = difference(&file, &model);
        assert!(found <= 1.2 * file.log_cosine_error + 1e-5, "{found}");
    }
    let model = isotropic(3, PLASTIC);
    let rough = encode(&model, &Channels::Rgb, "test", Some(8)).unwrap();
    assert_eq!(rough.resolution, 8);
    let fine = encode(&model, &Channels::Rgb, "test", Some(32)).unwrap();
    assert!(fine.log_cosine_error < 0.5 * rough.log_cosine_error);
}

/// A field as it stands in a file: type, shape, bytes.
type Field = (u8, Vec<usize>, Vec<u8>);

fn fields(bytes: &[u8]) -> HashMap<String, Field> {
    assert_eq!(&bytes[..14], b"tensor_file\0\x01\x00");
    let number = |at: usize, width: usize| {
        let digits = bytes[at..at + width].iter().rev();
        digits.fold(0, |sum, &byte| 256 * sum + usize::from(byte))
    };
    let mut at = 18;
    (0..number(14, 4))
        .map(|_| {
            let length = number(at, 2);
            let name = String::from_utf8(bytes[at + 2..at + 2 + length].to_vec()).unwrap();
            at += 2 + length;
            let (dimensions, code) = (number(at, 2), bytes[at + 2]);
            let offset = number(at + 3, 8);
            let shape: Vec<usize> = (0..dimensions)
                .map(|d| number(at + 11 + 8 * d, 8))
                .collect();
            at += 11 + 8 * dimensions;
            let width = match code {
                1 => 1,
                10 => 4,
                other => panic!("type {other}"),
            };
            let end = offset + width * shape.iter().product::<usize>();
            (name, (code, shape, bytes[offset..end].to_vec()))
        })
        .collect()
}

/// What pbrt-v4's `MeasuredBxDF` demands of a file: these fields with these types and shapes, azimuths around
/// the whole circle where there are more than two, values taken out by the jacobian; and what it divides by.
fn check_for_pbrt(bytes: &[u8]) {
    let fields = fields(bytes);
    let shape = |name: &str, code: u8, dimensions: usize| {
        let (found, shape, _) = &fields[name];
        assert_eq!((*found, shape.len()), (code, dimensions), "{name}");
        shape.clone()
    };
    let floats = |name: &str| -> Vec<f32> {
        let words = fields[name].2.as_chunks::<4>().0.iter();
        words.map(|&bytes| f32::from_le_bytes(bytes)).collect()
    };
    shape("description", 1, 1);
    let (theta_i, phi_i) = (shape("theta_i", 10, 1)[0], shape("phi_i", 10, 1)[0]);
    let wavelengths = shape("wavelengths", 10, 1)[0];
    shape("ndf", 10, 2);
    shape("sigma", 10, 2);
    let vndf = shape("vndf", 10, 4);
    assert_eq!(vndf[..2], [phi_i, theta_i]);
    let luminance = shape("luminance", 10, 4);
    assert_eq!(luminance[..2], [phi_i, theta_i]);
    assert_eq!(luminance[2], luminance[3]);
    let side = luminance[2];
    let spectra = shape("spectra", 10, 5);
    assert_eq!(spectra, [phi_i, theta_i, wavelengths, side, side]);
    assert_eq!(shape("jacobian", 1, 1), [1]);
    // It multiplies by D / (4 sigma) whatever this says.
    assert_eq!(fields["jacobian"].2, [1]);

    for name in ["theta_i", "phi_i", "wavelengths"] {
        assert!(
            floats(name).windows(2).all(|pair| pair[0] < pair[1]),
            "{name}"
        );
    }
    let thetas = floats("theta_i");
    assert!(thetas[0] >= 0.0 && f64::from(*thetas.last().unwrap()) < PI / 2.0 + 1e-6);
    if phi_i > 2 {
        let phis = floats("phi_i");
        let reduction = TAU / f64::from(phis.last().unwrap() - phis[0]);
        assert_eq!(reduction.round(), 1.0);
    }
    for name in ["ndf", "sigma"] {
        assert!(
            floats(name)
                .iter()
                .all(|&number| number > 0.0 && number.is_finite()),
            "{name}"
        );
    }
    assert!(
        floats("spectra")
            .iter()
            .all(|&number| number >= 0.0 && number.is_finite())
    );
    // Densities are divided by their integrals.
    for (name, size) in [("vndf", vndf[2] * vndf[3]), ("luminance", side * side)] {
        for slice in floats(name).chunks_exact(size) {
            assert!(
                slice
                    .iter()
                    .all(|&number| number > 0.0 && number.is_finite()),
                "{name}"
            );
        }
    }
}

#[test]
fn spectra_are_what_pbrt_demands_of_isotropic_and_brushed_and_black_materials() {
    let wavelengths = Channels::Spectrum(vec![400.0, 500.0, 600.0, 700.0]);
    let black: fn(&DirectionPair) -> f64 = |_| 0.0;
    let wild: fn(&DirectionPair) -> f64 = |pair| {
        if pair.incident[0] > 0.5 {
            f64::NAN
        } else {
            -1.0 + 1e300 * pair.outgoing[1]
        }
    };
    for model in [
        isotropic(4, PLASTIC),
        isotropic(4, black),
        isotropic(4, wild),
        steel(4),
    ] {
        let file = encode(&model, &wavelengths, "test", Some(12)).unwrap();
        check_for_pbrt(&file.bytes);
    }
    let file = encode(&isotropic(4, PLASTIC), &wavelengths, "test", Some(12)).unwrap();
    let read = Rgl::from_bytes(&file.bytes).unwrap();
    assert_eq!(read.channels(), &wavelengths);
}

#[test]
fn a_grain_is_held_by_azimuths_around_the_circle() {
    let file = encode(&steel(3), &Channels::Rgb, "test", Some(24)).unwrap();
    assert!(file.log_cosine_error < 3e-3, "{}", file.log_cosine_error);
    let (_, shape, _) = &fields(&file.bytes)["phi_i"];
    assert_eq!(shape, &[25]);
}

#[test]
fn what_no_file_can_hold_is_an_error_of_one_line() {
    let of = |channels: usize, wavelengths: &[f32], resolution| {
        let channels_of_file = if wavelengths.is_empty() {
            Channels::Rgb
        } else {
            Channels::Spectrum(wavelengths.to_vec())
        };
        let model = isotropic(channels, PLASTIC);
        let error = encode(&model, &channels_of_file, "test", resolution).unwrap_err();
        assert_eq!(error.to_string().lines().count(), 1);
        error
    };
    assert!(matches!(of(1, &[], None), WriteError::Channels { .. }));
    let many: Vec<f32> = (0..1000).map(|k| 400.0 + k as f32).collect();
    assert!(matches!(
        of(1000, &many, None),
        WriteError::Wavelengths { found: 1000 }
    ));
    assert!(matches!(
        of(2, &[500.0, 400.0], None),
        WriteError::Order { .. }
    ));
    assert!(matches!(
        of(3, &[], Some(2)),
        WriteError::Resolution { found: 2 }
    ));
    let fine: Vec<f32> = (0..500).map(|k| 400.0 + k as f32).collect();
    assert!(matches!(of(500, &fine, Some(256)), WriteError::Size { .. }));
}
