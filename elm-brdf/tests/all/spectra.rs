//! Spectral materials: known by their wavelengths, fitted with few outputs, shown in color.

use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::support::Program;
use elm_brdf::Error;
use elm_brdf::batch::Packed;
use elm_brdf::export::{Language, merl, source};
use elm_brdf::fit::Model;
use elm_brdf::metrics::{Metric, Metrics};
use elm_brdf::model::{BrdfModel, Tuned};
use elm_datasets::color::SpectralColor;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::scattered::{self, AngleUnit, Options};
use elm_datasets::{Angles, Brdf, Samples, lobes};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A colored metal in a lacquer of another color, from 400 nm in steps of 25: no exact sum of two spectra,
/// for the metal whitens towards grazing.
fn lacquer(pair: &DirectionPair) -> [f64; 13] {
    let between = pair.cos_between();
    let cos_d = ((1.0 + between) / 2.0).max(0.0).sqrt();
    std::array::from_fn(|k| {
        let x = k as f64 / 12.0;
        let metal = 0.3 + 0.6 / (1.0 + (-(x - 0.5) * 12.0).exp());
        let fresnel = metal + (1.0 - metal) * (1.0 - cos_d).powi(5);
        let base = 0.05 + 0.3 * (-((x - 0.2) / 0.2).powi(2)).exp();
        base / PI + lobes::ggx(pair, 1.0, 0.3) * fresnel
    })
}

fn samples(rows: usize, seed: u64) -> Samples {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut angle = |most: f64| random.random_range(0.0..most);
    let directions: Vec<DirectionPair> = (0..rows)
        .map(|_| DirectionPair {
            incident: cartesian(angle(1.3), angle(2.0 * PI)),
            outgoing: cartesian(angle(1.3), angle(2.0 * PI)),
        })
        .collect();
    let values = Array2::from_shape_fn((rows, 13), |(row, k)| lacquer(&directions[row])[k]);
    Samples {
        channels: (0..13).map(|k| format!("{} nm", 400 + 25 * k)).collect(),
        directions,
        values,
    }
}

fn fitted(samples: &Samples, tuned: &Tuned) -> BrdfModel {
    let model = tuned
        .fit_model(&samples.directions, samples.values.view())
        .unwrap();
    let mut about = model.provenance().clone();
    about.channels.clone_from(&samples.channels);
    model.with_provenance(about)
}

const LOG_COSINE: Tuned = Tuned {
    features: None,
    reciprocal: false,
    metric: Metric::LogCosine,
    neurons: Some(60),
    max_floats: None,
    seed: 1,
};

#[test]
fn few_outputs_serve_many_wavelengths_and_all_that_is_stored_counts() {
    for rows in [200, 1600] {
        let (train, test) = (samples(rows, 1), samples(500, 2));
        let model = fitted(&train, &LOG_COSINE);
        let outputs = model.network().outputs();
        assert!((1..=6).contains(&outputs), "{outputs}");
        assert_eq!(
            (model.channels(), model.target_transform().outputs()),
            (13, outputs)
        );
        // Output weights and constants; three numbers for each of the inputs; offset, largest value, mean and
        // parts of the axes for each wavelength; and a bit for each neuron drawn.
        let inputs = model.network().inputs();
        let fixed = outputs * 61 + 3 * inputs + 13 * (3 + outputs);
        let found = model.stored_floats();
        assert!((fixed..fixed + 12).contains(&found), "{found} {fixed}");
        let share = model.floats_per_channel();
        assert_eq!(found - share, 12 * (3 + outputs));
        let values = model.eval(&test.directions).unwrap();
        let errors = Metrics::of(&test.directions, values.view(), test.values.view()).unwrap();
        // The mean of ln(1 + f cos) itself is about 0.15.
        let most = if rows > 1000 { 0.003 } else { 0.01 };
        assert!(
            errors.log_cosine_mae < most,
            "{rows}: {}",
            errors.log_cosine_mae
        );
    }
}

#[test]
fn what_may_be_stored_is_kept_to_and_a_limit_too_low_is_one_line() {
    let train = samples(300, 1);
    let within = |most: usize| Tuned {
        max_floats: Some(most),
        neurons: None,
        ..LOG_COSINE
    };
    let model = fitted(&train, &within(300));
    assert!(model.stored_floats() <= 300, "{}", model.stored_floats());
    let refused = within(40).fit_model(&train.directions, train.values.view());
    let text = refused.unwrap_err().to_string();
    assert!(
        text.contains("max_floats is 40") && !text.contains('\n'),
        "{text}"
    );
}

#[test]
fn pictures_packed_models_and_tables_have_the_color_of_the_spectrum() {
    let train = samples(400, 1);
    let model = fitted(&train, &LOG_COSINE);
    let shown = model.in_color().unwrap();
    assert_eq!(shown.provenance().channels, ["red", "green", "blue"]);
    let pairs = samples(150, 3).directions;
    let color = SpectralColor::of(&train.channels).unwrap().unwrap();
    let expected = color.visible(model.eval(&pairs).unwrap().view());
    let close = |found: Array2<f64>, epsilon: f64| {
        approx::assert_abs_diff_eq!(found, expected, epsilon = epsilon);
    };
    close(shown.eval(&pairs).unwrap(), 1e-12);
    close(
        Packed::<f64>::new(&shown).unwrap().eval(&pairs).unwrap(),
        1e-9,
    );
    close(
        Packed::<f32>::new(&shown).unwrap().eval(&pairs).unwrap(),
        1e-3,
    );
    let all = Packed::<f64>::new(&model).unwrap().eval(&pairs).unwrap();
    approx::assert_abs_diff_eq!(all, model.eval(&pairs).unwrap(), epsilon = 1e-9);
    // A table has the color too, of the middle of a cell.
    let table = merl(&model).unwrap();
    let normal = DirectionPair::from(Angles {
        theta_i: 0.3,
        phi_i: 0.0,
        theta_o: 0.5,
        phi_o: 2.0,
    });
    let (found, expected) = (
        table.eval(&[normal]).unwrap(),
        shown.eval(&[normal]).unwrap(),
    );
    approx::assert_relative_eq!(found, expected, max_relative = 0.05);
    // Files hold a spectrum, and its colors.
    let dir = tempfile::tempdir().unwrap();
    for (name, model) in [("a.elm", &model), ("b.json", &shown)] {
        let path = dir.path().join(name);
        model.save(&path).unwrap();
        assert_eq!(&BrdfModel::load(&path).unwrap(), model);
    }
    let text = source(&model, Language::Glsl, "lacquer").unwrap();
    assert!(
        text.contains("linear sRGB of 13 wavelengths under D65"),
        "{text}"
    );
}

#[test]
fn what_is_no_spectrum_or_not_visible_has_no_color() {
    let mut train = samples(120, 1);
    let model = |samples: &Samples| fitted(samples, &LOG_COSINE);
    train.channels = (0..13).map(|k| format!("{} nm", 900 + 25 * k)).collect();
    let error = source(&model(&train), Language::C, "m")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("from 900 to 1200 nm have no color"),
        "{error}"
    );
    train.channels = (0..13).map(|k| format!("c{k}")).collect();
    let error = source(&model(&train), Language::C, "m").unwrap_err();
    assert!(matches!(error, Error::Channels { channels: 13 }), "{error}");
}

/// A table with the columns' names.
fn table(samples: &Samples, names: &[String]) -> String {
    let mut text = format!("theta_i,phi_i,theta_o,phi_o,{}\n", names.join(","));
    for (pair, values) in samples.directions.iter().zip(samples.values.rows()) {
        let a = Angles::of(pair);
        write!(text, "{},{},{},{}", a.theta_i, a.phi_i, a.theta_o, a.phi_o).unwrap();
        for value in values {
            write!(text, ",{value}").unwrap();
        }
        text.push('\n');
    }
    text
}

#[test]
fn the_program_takes_wavelengths_by_name_or_by_option_and_refuses_what_is_none() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let some = samples(60, 1);
    let unnamed: Vec<String> = (0..13).map(|k| format!("band {k}")).collect();
    let mut twice = some.channels.clone();
    twice[4] = "475.0".to_owned();
    fs::write(path("named.csv"), table(&some, &some.channels)).unwrap();
    fs::write(path("unnamed.csv"), table(&some, &unnamed)).unwrap();
    fs::write(path("twice.csv"), table(&some, &twice)).unwrap();
    let program = Program::new();
    let fit = |file: &str, more: &[&str]| {
        let mut command = program.command();
        let (file, model) = (path(file), path("model.elm"));
        command
            .args(["fit", &file, "-o", &model, "--neurons", "20"])
            .args(more);
        command.assert()
    };
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let described = "channels 13 wavelengths from 400 to 700 nm";
    for (file, more) in [
        ("named.csv", &[][..]),
        ("unnamed.csv", &["--wavelengths", "400:700:25"][..]),
    ] {
        let assert = fit(file, more).success();
        let out = text(&assert.get_output().stdout);
        assert!(out.contains(described) && out.contains("outputs"), "{out}");
        let (model, shader) = (path("model.elm"), path("model.c"));
        let export = ["export", &model, "-o", &shader];
        program.output(&export);
    }
    for (file, more, expected) in [
        (
            "unnamed.csv",
            &["--wavelengths", "400:700:50"][..],
            "7 wavelengths are given for 13 channels",
        ),
        (
            "unnamed.csv",
            &["--wavelengths", "400:700"][..],
            "expected wavelengths in nm",
        ),
        ("twice.csv", &[][..], "are of the same wavelength"),
    ] {
        let assert = fit(file, more).failure();
        let error = text(&assert.get_output().stderr);
        assert!(error.contains(expected), "{error}");
    }
    // Without wavelengths there is a model, but no color.
    fit("unnamed.csv", &[]).success();
    let (model, shader) = (path("model.elm"), path("no.glsl"));
    let mut export = program.command();
    let assert = export
        .args(["export", &model, "-o", &shader])
        .assert()
        .failure();
    let error = text(&assert.get_output().stderr);
    assert!(error.contains("13 channels has no color"), "{error}");
    assert!(!Path::new(&shader).exists());
}

#[test]
fn scenes_show_spectra_fitted_saved_and_interpolated() {
    let dir = tempfile::tempdir().unwrap();
    let some = samples(150, 1);
    fs::write(dir.path().join("lacquer.csv"), table(&some, &some.channels)).unwrap();
    let model = fitted(&some, &LOG_COSINE);
    model.save(dir.path().join("lacquer.elm")).unwrap();
    let program = Program::new();
    for source in [
        "model = 'lacquer.elm'",
        "csv = 'lacquer.csv'",
        "csv = 'lacquer.csv'\nfit = 'interpolation'",
    ] {
        let scene = format!(
            "[image]\nwidth = 8\nheight = 8\nsamples = 4\n\
             [camera]\nposition = [0, 0, 5]\ntarget = [0, 0, 0]\nheight = 2\n\
             [material.m]\n{source}\n\
             [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n\
             [[directional]]\ntowards = [0, 0, 1]\nirradiance = [3, 3, 3]\n"
        );
        let file = dir.path().join("scene.toml");
        fs::write(&file, scene).unwrap();
        let picture = dir.path().join("picture.png");
        let arguments = [
            "render",
            file.to_str().unwrap(),
            "-o",
            picture.to_str().unwrap(),
        ];
        program.command().args(arguments).assert().success();
        assert!(picture.exists(), "{source}");
    }
}

/// CIE L*, a*, b* of linear sRGB, white at 1.
fn lab([r, g, b]: [f64; 3]) -> [f64; 3] {
    // IEC 61966-2-1, rows divided by the white's values.
    let xyz = [
        (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505,
        0.2126 * r + 0.7152 * g + 0.0722 * b,
        (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.0890,
    ];
    let [x, y, z] = xyz.map(|t| {
        if t > (6.0_f64 / 29.0).powi(3) {
            t.cbrt()
        } else {
            t / (3.0 * (6.0_f64 / 29.0).powi(2)) + 4.0 / 29.0
        }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// G. Sharma, W. Wu, E. Dalal, *The CIEDE2000 Color-Difference Formula*, Color Research and Application
/// 30(1), 2005, equations 2 to 22.
fn ciede2000([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
    let mean_c = f64::midpoint(a1.hypot(b1), a2.hypot(b2)).powi(7);
    let g = 0.5 * (1.0 - (mean_c / (mean_c + 25.0_f64.powi(7))).sqrt());
    let (a1, a2) = ((1.0 + g) * a1, (1.0 + g) * a2);
    let (c1, c2) = (a1.hypot(b1), a2.hypot(b2));
    let hue = |a: f64, b: f64| b.atan2(a).to_degrees().rem_euclid(360.0);
    let (h1, h2) = (hue(a1, b1), hue(a2, b2));
    let grey = c1 * c2 == 0.0;
    let dh = if grey {
        0.0
    } else {
        (h2 - h1 + 180.0).rem_euclid(360.0) - 180.0
    };
    let big_h = 2.0 * (c1 * c2).sqrt() * (dh / 2.0).to_radians().sin();
    let (l, c) = (f64::midpoint(l1, l2), f64::midpoint(c1, c2));
    let h = match (grey, (h1 - h2).abs() <= 180.0) {
        (true, _) => h1 + h2,
        (false, true) => f64::midpoint(h1, h2),
        (false, false) if h1 + h2 < 360.0 => f64::midpoint(h1, h2) + 180.0,
        (false, false) => f64::midpoint(h1, h2) - 180.0,
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0)
        - 0.20 * cos(4.0 * h - 63.0);
    let turn = 30.0 * (-((h - 275.0) / 25.0).powi(2)).exp();
    let rc = 2.0 * (c.powi(7) / (c.powi(7) + 25.0_f64.powi(7))).sqrt();
    let sl = 1.0 + 0.015 * (l - 50.0).powi(2) / (20.0 + (l - 50.0).powi(2)).sqrt();
    let (sc, sh) = (1.0 + 0.045 * c, 1.0 + 0.015 * c * t);
    let (dl, dc, dh) = ((l2 - l1) / sl, (c2 - c1) / sc, big_h / sh);
    let rt = -(2.0 * turn).to_radians().sin() * rc;
    (dl * dl + dc * dc + dh * dh + rt * dc * dh).sqrt()
}

#[test]
fn the_color_difference_is_that_of_the_published_pairs() {
    // Table 1 of the publication, pairs 1, 17, 21 and 34.
    for (one, other, expected) in [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [50.0, 3.1736, 0.5854], 1.0000),
        (
            [2.0776, 0.0795, -1.1350],
            [0.9033, -0.0636, -0.5514],
            0.9082,
        ),
    ] {
        let found = ciede2000(one, other);
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    }
}

#[test]
#[ignore = "needs the spectral material, in ELM_BRDF_DATA or ../shared/spectral"]
fn a_thousand_numbers_hold_copper_paint_and_its_color() {
    let Some(dir) = elm_test_support::folder("spectral") else {
        return;
    };
    let read = |name: &str| {
        let options = Options {
            unit: AngleUnit::Degrees,
            ..Options::default()
        };
        scattered::read(dir.join(name), &options).unwrap()
    };
    let (train, test) = (read("copper_train.csv"), read("copper_test.csv"));
    let tuned = Tuned {
        max_floats: Some(1000),
        neurons: None,
        ..LOG_COSINE
    };
    let model = fitted(&train, &tuned);
    let pairs = &test.directions;
    let values = model.eval(pairs).unwrap();
    let errors = Metrics::of(pairs, values.view(), test.values.view()).unwrap();
    let found = model.in_color().unwrap().eval(pairs).unwrap();
    let expected = test.clone().in_color().unwrap().values;
    let row = |values: &Array2<f64>, row: usize| {
        // As the renderer shows it where the irradiance is that which a white surface returns as 1.
        lab([0, 1, 2].map(|k| PI * values[[row, k]]))
    };
    let differences = (0..pairs.len()).map(|k| ciede2000(row(&found, k), row(&expected, k)));
    let mut differences: Vec<f64> = differences.collect();
    differences.sort_by(f64::total_cmp);
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    println!(
        "{} outputs, {} numbers: log-cosine {:.5}, CIEDE2000 mean {mean:.3}, 99 % {:.3}, largest {:.3}",
        model.network().outputs(),
        model.stored_floats(),
        errors.log_cosine_mae,
        differences[differences.len() * 99 / 100],
        differences[differences.len() - 1]
    );
    assert!(model.stored_floats() <= 1000);
    assert!(errors.log_cosine_mae <= 0.0014, "{}", errors.log_cosine_mae);
    assert!(mean <= 1.0, "{mean}");
}
