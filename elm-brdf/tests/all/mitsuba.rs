//! Exports for renderers in Mitsuba 3 itself: `.bsdf` files by its plug-in `measured`, and plug-ins of our
//! own.
//!
//! Needs a Python with `mitsuba` 3.9.1 and `numpy`, which `ELM_BRDF_MITSUBA` names (else `python3`), and for
//! its LLVM variants LLVM 15 or later (`DRJIT_LIBLLVM_PATH`).

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use elm::{Activation, ElmParams, solve::Ridge};
use elm_brdf::export::{bsdf, plugin};
use elm_brdf::features::Features;
use elm_brdf::metrics::Metrics;
use elm_brdf::model::{BrdfModel, BrdfParams, Tuned};
use elm_brdf::render::Rendering;
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::geometry::{DirectionPair, cartesian, reflect};
use elm_datasets::scattered::{self, Options};
use elm_datasets::{Brdf, Invalid, MaterialId, curet, lobes};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::rgl_spheres::sphere;

/// Half of them anywhere, half near the mirror direction.
fn pairs(count: usize, seed: u64) -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut number = |least: f64, most: f64| random.random_range(least..most);
    let mut pairs = Vec::new();
    while pairs.len() < count {
        let incident = cartesian(number(0.087, 1.0).acos(), number(0.0, TAU));
        let outgoing = if pairs.len() % 2 == 0 {
            cartesian(number(0.087, 1.0).acos(), number(0.0, TAU))
        } else {
            reflect(incident, cartesian(number(0.0, 0.3), number(0.0, TAU)))
        };
        if outgoing[2] > 0.087 {
            pairs.push(DirectionPair { incident, outgoing });
        }
    }
    pairs
}

fn fitted(features: Features, formula: impl Fn(&DirectionPair) -> f64) -> BrdfModel {
    let pairs = pairs(3000, 1);
    let values = Array2::from_shape_fn((pairs.len(), 3), |(row, channel)| {
        (0.5 + 0.25 * channel as f64) * formula(&pairs[row])
    });
    let network = ElmParams::new(120)
        .with_activation(Activation::Sine)
        .with_solver(Ridge::leave_one_out())
        .with_seed(3);
    let params = BrdfParams {
        features,
        transform: TargetTransform::default_log(),
        network,
    };
    params.fit_model(&pairs, values.view()).unwrap()
}

/// What Mitsuba says of each material, a value of JSON for each figure.
fn asked(python: &Path, materials: &[(String, BrdfModel)], data: Option<&Path>) -> Vec<Value> {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str, end: &str| dir.path().join(format!("{name}{end}"));
    for (name, model) in materials {
        let names = &model.provenance().channels;
        let file = bsdf(model.clone(), names, name, false, None).unwrap();
        println!(
            "{name}: {0} x {0}, {1} bytes, log-cosine error {2:.5}",
            file.resolution,
            file.bytes.len(),
            file.log_cosine_error
        );
        std::fs::write(path(name, ".bsdf"), &file.bytes).unwrap();
        std::fs::write(path(name, ".py"), plugin(model, name, name).unwrap()).unwrap();
        // As Mitsuba reads them.
        let single = |w: [f64; 3]| w.map(|c| f64::from(c as f32));
        let pairs: Vec<DirectionPair> = pairs(20_000, 9)
            .into_iter()
            .map(|pair| DirectionPair {
                incident: single(pair.incident),
                outgoing: single(pair.outgoing),
            })
            .collect();
        let values = model.in_rgb_order().unwrap().eval(&pairs).unwrap();
        let mut text = String::new();
        for (pair, row) in pairs.iter().zip(values.rows()) {
            let numbers = pair.incident.iter().chain(&pair.outgoing).chain(row);
            let numbers: Vec<String> = numbers.map(|number| format!("{number:e}")).collect();
            let _ = writeln!(text, "{}", numbers.join(","));
        }
        std::fs::write(path(name, ".csv"), text).unwrap();
        if let Some(reference) = data.map(|data| data.join(format!("{name}_rgb_sphere.exr")))
            && reference.is_file()
        {
            std::fs::copy(reference, path(name, "_sphere.exr")).unwrap();
            model.save(path(name, ".elm")).unwrap();
            let ours = sphere(dir.path(), &format!("model = '{name}.elm'"));
            let file = path(name, "_ours.exr");
            let format = Rendering::format(&file).unwrap();
            std::fs::write(file, ours.encode(format).unwrap()).unwrap();
        }
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/all/mitsuba_check.py");
    let mut run = Command::new(python)
        .arg(script)
        .arg(dir.path())
        .args(materials.iter().map(|(name, _)| name))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(run.stdout.take().unwrap()).lines();
    let found = lines
        .map_while(Result::ok)
        .filter(|line| line.starts_with('{'))
        .inspect(|line| println!("{line}"))
        .map(|line| serde_json::from_str(&line).unwrap())
        .collect();
    assert!(run.wait().unwrap().success());
    found
}

/// The bounds that hold for every material; `error` is the model's own log-cosine error, where it is known.
fn check(found: &[Value], material: &str, model: &BrdfModel, error: f64) {
    let of = |what: &'static str| {
        let lines = found.iter().filter(move |line| line["what"] == what);
        lines.filter(|line| line["material"] == material)
    };
    for line in of("measured values") {
        let found = line["log_cosine"].as_f64().unwrap();
        assert!(found <= 0.002 + 0.03 * error, "{line}");
    }
    for line in of("elm values") {
        // In place of the value where there is none, 1e-3 per steradian.
        assert!(line["relative"].as_f64().unwrap() <= 1e-4, "{line}");
    }
    for line in of("elm values, single") {
        // What single precision costs this network, by its own weights, as a part of the values.
        let cost = model.single_precision_error().unwrap();
        let bound = cost.rmse / cost.scale;
        assert!(line["rms"].as_f64().unwrap() <= bound, "{line}, {bound}");
    }
    for what in ["measured chi-square", "elm chi-square"] {
        assert_eq!(of(what).count(), 5);
        for line in of(what) {
            assert_eq!(line["passed"], true, "{line}");
        }
    }
    let psnr = |what| of(what).next().map(|line| line["psnr"].as_f64().unwrap());
    if let (Some(ours), Some(theirs)) = (psnr("renderer sphere"), psnr("elm sphere")) {
        assert!(
            (ours - theirs).abs() <= 0.3,
            "{material}: {ours} dB here, {theirs} there"
        );
    }
    for what in ["measured furnace", "elm furnace"] {
        for line in of(what) {
            // Of 256 samples each; a firefly is a sample of some hundred times the mean.
            assert!(line["largest"].as_f64().unwrap() < 1.5, "{line}");
            assert!(line["least"].as_f64().unwrap() > 0.6, "{line}");
        }
    }
}

#[test]
#[ignore = "needs Mitsuba"]
fn mitsuba_agrees_with_a_glossy_material() {
    let Some(python) = elm_test_support::mitsuba() else {
        return;
    };
    // Not a name of Mitsuba's own.
    let glossy = fitted(Features::Highlight, |pair| {
        0.2 / PI + lobes::ggx(pair, 0.05, 0.2)
    });
    let materials = [("glossy".to_owned(), glossy)];
    let found = asked(&python, &materials, None);
    check(&found, "glossy", &materials[0].1, 0.0);
}

#[test]
fn names_of_mitsubas_own_are_refused() {
    let model = fitted(Features::Highlight, |_| 0.2 / PI);
    let error = plugin(&model, "file", "plastic").unwrap_err().to_string();
    assert!(
        error.contains("plastic") && !error.contains('\n'),
        "{error}"
    );
}

#[test]
#[ignore = "by hand: needs Mitsuba, measurements and some minutes"]
fn mitsuba_agrees_with_measured_materials() {
    let Some(python) = elm_test_support::mitsuba() else {
        return;
    };
    let folders = ["rgl", "aniso"].map(elm_test_support::folder);
    let ([Some(rgl), Some(aniso)], Some(felt)) = (folders, elm_test_support::curet()) else {
        return;
    };
    let mut materials = Vec::new();
    let mut errors = Vec::new();
    for (name, folder, end) in [
        ("cc_iris_purple_gem", &rgl, "_rgb"),
        ("paper_white", &rgl, "_rgb"),
        ("vch_golden_yellow", &rgl, "_rgb"),
        ("brushed", &aniso, ""),
    ] {
        let read = |part: &str| {
            let file = folder.join(format!("{name}{end}_{part}.csv"));
            scattered::read(file, &Options::default()).unwrap()
        };
        let (train, test) = (read("train"), read("test"));
        let model = Tuned::default()
            .fit_model(&train.directions, train.values.view())
            .unwrap();
        let values = model.eval(&test.directions).unwrap();
        let metrics = Metrics::of(&test.directions, test.values.view(), values.view()).unwrap();
        println!("{name}: log-cosine error {}", metrics.log_cosine_mae);
        errors.push(metrics.log_cosine_mae);
        materials.push((name.to_owned(), model));
    }
    let id = MaterialId::new(20).unwrap();
    let data = curet::read(&felt, &[id], Invalid::Clamp).unwrap();
    let samples = data.samples(0).unwrap();
    let model = Tuned::default()
        .fit_model(&samples.directions, samples.values.view())
        .unwrap();
    materials.push(("curet_20".to_owned(), model));
    errors.push(0.0);
    let found = asked(&python, &materials, Some(&rgl));
    for ((name, model), error) in materials.iter().zip(errors) {
        check(&found, name, model, error);
    }
}
