//! The samplers of exported sources: their densities are those of the mixture that the renderer samples by,
//! have the integral 1, and describe what is drawn. C compiled and run, shaders in a headless browser.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::Write as _;
use std::process::Command;

use crate::browser::shader_values;
use crate::exports::network;
use elm::Activation;
use elm_brdf::export::{Language, header, source};
use elm_brdf::features::Features;
use elm_brdf::model::{BrdfModel, BrdfParams};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::geometry::{DirectionPair, Vector, cartesian, polar, reflect};
use elm_datasets::lobes;
use elm_datasets::mixture::LobeMixture;
use elm_test_support::{chromium, program};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Viewing angles in radians.
const VIEWS: [f64; 5] = [0.0, 0.4, 0.8, 1.2, 1.5];

/// Half of them anywhere, half near the mirror direction.
fn scattered(count: usize) -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut number = |most: f64| random.random_range(0.0..most);
    let mut pairs = Vec::new();
    while pairs.len() < count {
        let incident = cartesian(number(1.5), number(TAU));
        let outgoing = if pairs.len() % 2 == 0 {
            cartesian(number(1.5), number(TAU))
        } else {
            reflect(incident, cartesian(number(0.3), number(TAU)))
        };
        if outgoing[2] > 0.05 {
            pairs.push(DirectionPair { incident, outgoing });
        }
    }
    pairs
}

fn fitted(features: Features, formula: impl Fn(&DirectionPair) -> f64) -> BrdfModel {
    let pairs = scattered(2000);
    let values = Array2::from_shape_fn((pairs.len(), 3), |(row, channel)| {
        (0.5 + 0.25 * channel as f64) * formula(&pairs[row])
    });
    let params = BrdfParams {
        features,
        transform: TargetTransform::default_log(),
        network: network(80, Activation::Sine),
    };
    params.fit_model(&pairs, values.view()).unwrap()
}

/// A rough, a glossy and a brushed material, and one that reflects back, each with the name of its functions.
fn materials() -> Vec<(&'static str, BrdfModel)> {
    let retro = |pair: &DirectionPair| 0.1 + 3.0 * (20.0 * (pair.cos_between() - 1.0)).exp();
    vec![
        (
            "chalk",
            fitted(Features::Highlight, |pair| {
                lobes::oren_nayar(pair, 0.7, 0.5)
            }),
        ),
        (
            "paint",
            fitted(Features::Highlight, |pair| {
                0.05 / PI + lobes::ggx(pair, 0.05, 0.06)
            }),
        ),
        ("tape", fitted(Features::ReciprocalCosines, retro)),
        (
            "steel",
            fitted(Features::Anisotropic { degrees: 30 }, |pair| {
                0.05 / PI + lobes::anisotropic_ggx(pair, 0.8, [0.12, 0.45], 0.5)
            }),
        ),
    ]
}

/// Bins of equal angles in theta and phi.
const THETAS: usize = 6;
const PHIS: usize = 8;

fn bin(direction: Vector) -> usize {
    let (theta, phi) = polar(direction);
    let row = (theta / FRAC_PI_2 * THETAS as f64) as usize;
    let column = (phi.rem_euclid(TAU) / TAU * PHIS as f64) as usize;
    row.min(THETAS - 1) * PHIS + column.min(PHIS - 1)
}

/// Pearson's statistic of draws over their expected number in each bin, and what a right sampler passes
/// once in three million times (Wilson and Hilferty).
fn chi_square(counts: &[f64], shares: &[f64]) -> (f64, f64) {
    let draws: f64 = counts.iter().sum();
    let total: f64 = shares.iter().sum();
    let (mut statistic, mut bins) = (0.0, 0.0);
    // Bins with less than five draws count as one.
    let (mut rare, mut few) = (0.0, 0.0);
    for (count, share) in counts.iter().zip(shares) {
        let expected = share / total * draws;
        if expected < 5.0 {
            rare += expected;
            few += count;
            continue;
        }
        statistic += (count - expected) * (count - expected) / expected;
        bins += 1.0;
    }
    if rare > 0.0 {
        statistic += (few - rare) * (few - rare) / rare.max(1.0);
        bins += 1.0;
    }
    let freedom: f64 = bins - 1.0;
    let spread = 2.0 / (9.0 * freedom);
    (
        statistic,
        freedom * (1.0 - spread + 5.0 * spread.sqrt()).powi(3),
    )
}

/// What the program in C is: it answers for each material and viewer with the density's integral over each
/// bin, by midpoints, and counts of draws, and for each pair with the density.
fn main_of(names: &[&str]) -> String {
    let mut text = String::from(
        "#include <stdio.h>\n#include <stdint.h>\n\
         static uint64_t state = 1;\n\
         static float uniform(void) {\n\
             state = state * 6364136223846793005u + 1442695040888963407u;\n\
             return (float)(state >> 40) / 16777216.0f;\n}\n\
         static int bin(const float w[3]) {\n\
             const double pi = 3.141592653589793;\n\
             double phi = atan2((double)w[1], (double)w[0]);\n\
             if (phi < 0.0) { phi += 2.0 * pi; }\n\
             int row = (int)(atan2(hypot((double)w[0], (double)w[1]), (double)w[2]) / pi * 2.0 * THETAS);\n\
             int column = (int)(phi / (2.0 * pi) * PHIS);\n\
             row = row < THETAS ? row : THETAS - 1;\n\
             column = column < PHIS ? column : PHIS - 1;\n\
             return row * PHIS + column;\n}\n",
    );
    for name in names {
        let part = r#"static int survey_NAME(const float v[3]) {
    static double parts[THETAS * PHIS], counts[THETAS * PHIS];
    const int rows = THETAS * 150, columns = PHIS * 250, draws = 100000;
    int bad = 0;
    for (int k = 0; k < THETAS * PHIS; ++k) { parts[k] = counts[k] = 0.0; }
    for (int r = 0; r < rows; ++r) {
        const double pi = 3.141592653589793;
        const double low = cos(r * pi / 2 / rows), high = cos((r + 1) * pi / 2 / rows);
        const double z = (low + high) / 2, sine = sqrt(1.0 - z * z);
        for (int c = 0; c < columns; ++c) {
            const double phi = (c + 0.5) * 2 * pi / columns;
            const float w[3] = {(float)(sine * cos(phi)), (float)(sine * sin(phi)), (float)z};
            parts[bin(w)] += (double)NAME_pdf(w, v) * (low - high) * 2 * pi / columns;
        }
    }
    for (int k = 0; k < draws; ++k) {
        const float u[2] = {uniform(), uniform()};
        float w[3];
        const float pdf = NAME_sample(v, u, w);
        const float length = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
        bad += !(pdf > 0.0f && pdf == NAME_pdf(w, v) && fabsf(length - 1.0f) < 1e-5f);
        counts[bin(w)] += 1.0;
    }
    for (int k = 0; k < THETAS * PHIS; ++k) { printf("%.9g %.9g ", parts[k], counts[k]); }
    printf("%d\n", bad);
    return 0;
}
"#;
        text += &part.replace("NAME", name);
    }
    text += "int main(void) {\n    int what;\n    float l[3], v[3];\n    while (scanf(\"%d %f %f %f %f %f %f\", &what, l, l + 1, \
             l + 2, v, v + 1, v + 2) == 7) {\n        switch (what) {\n";
    for (index, name) in names.iter().enumerate() {
        let (pdf, survey) = (2 * index, 2 * index + 1);
        let _ = writeln!(
            text,
            "        case {pdf}: printf(\"%.9g\\n\", (double){name}_pdf(l, v)); break;\n        \
             case {survey}: survey_{name}(v); break;"
        );
    }
    text + "        }\n    }\n    return 0;\n}\n"
}

#[test]
#[ignore = "needs a C compiler"]
fn densities_in_c_are_the_mixtures_have_the_integral_1_and_are_drawn_by() {
    let Some(cc) = program("cc") else { return };
    let materials = materials();
    let names: Vec<&str> = materials.iter().map(|(name, _)| *name).collect();
    let mut text = format!("#define THETAS {THETAS}\n#define PHIS {PHIS}\n");
    for (name, model) in &materials {
        // Public functions and those of a header alike.
        let source = source(model, Language::C, name).unwrap();
        text += &if *name == "paint" {
            header(&source, name)
        } else {
            source
        };
    }
    text += &main_of(&names);
    let dir = tempfile::tempdir().unwrap();
    let (file, binary) = (dir.path().join("samplers.c"), dir.path().join("samplers"));
    std::fs::write(&file, text).unwrap();
    let compiled = Command::new(cc)
        .args([
            "-std=c99",
            "-O2",
            "-Wall",
            "-Wextra",
            "-Wdouble-promotion",
            "-Wconversion",
        ])
        .args(["-Werror", "-pedantic", "-o"])
        .args([&binary, &file])
        .arg("-lm")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&compiled.stderr);
    assert!(compiled.status.success(), "{said}");

    let single = |w: Vector| w.map(|c| f64::from(c as f32));
    let pairs: Vec<DirectionPair> = scattered(2000)
        .into_iter()
        .map(|pair| DirectionPair {
            incident: single(pair.incident),
            outgoing: single(pair.outgoing),
        })
        .collect();
    let mut questions = String::new();
    for index in 0..names.len() {
        for pair in &pairs {
            let [a, b, c] = pair.incident;
            let [x, y, z] = pair.outgoing;
            let _ = writeln!(
                questions,
                "{} {a:e} {b:e} {c:e} {x:e} {y:e} {z:e}",
                2 * index
            );
        }
        for view in VIEWS {
            let [x, y, z] = cartesian(view, 0.3);
            let _ = writeln!(questions, "{} 0 0 1 {x:e} {y:e} {z:e}", 2 * index + 1);
        }
    }
    let asked = dir.path().join("questions");
    std::fs::write(&asked, questions).unwrap();
    let run = Command::new(binary)
        .stdin(std::fs::File::open(asked).unwrap())
        .output()
        .unwrap();
    let text = String::from_utf8(run.stdout).unwrap();
    let mut lines = text.lines();
    for (name, model) in &materials {
        let mixture = LobeMixture::of(model).unwrap();
        let mut worst = 0.0_f64;
        for pair in &pairs {
            let found: f64 = lines.next().unwrap().parse().unwrap();
            let expected = mixture.density(pair.outgoing, pair.incident);
            worst = worst.max((found / expected - 1.0).abs());
        }
        assert!(worst < 2e-3, "{name}: {worst}");
        for view in VIEWS {
            let numbers: Vec<f64> = lines
                .next()
                .unwrap()
                .split(' ')
                .map(|number| number.parse().unwrap())
                .collect();
            let (bad, numbers) = numbers.split_last().unwrap();
            let rows = numbers.as_chunks::<2>().0;
            let shares: Vec<f64> = rows.iter().map(|row| row[0]).collect();
            let counts: Vec<f64> = rows.iter().map(|row| row[1]).collect();
            let total: f64 = shares.iter().sum();
            let (statistic, limit) = chi_square(&counts, &shares);
            println!(
                "C {name} at {view}: densities off by {worst:.1e}, integral {total:.5}, chi-square \
                 {statistic:.1} of {limit:.1}"
            );
            assert_eq!(*bad, 0.0, "{name} at {view}");
            assert!((total - 1.0).abs() < 5e-3, "{name} at {view}: {total}");
            assert!(
                statistic < limit,
                "{name} at {view}: {statistic} of {limit}"
            );
        }
    }
}

/// The mixture's integral over each bin, by midpoints.
fn shares(mixture: &LobeMixture, viewer: Vector) -> Vec<f64> {
    const FINE: usize = 40;
    let mut shares = vec![0.0; THETAS * PHIS];
    let (rows, columns) = (THETAS * FINE, PHIS * FINE);
    for row in 0..rows {
        let cosine = |row: usize| (row as f64 / rows as f64 * FRAC_PI_2).cos();
        let (low, high) = (cosine(row), cosine(row + 1));
        for column in 0..columns {
            let phi = (column as f64 + 0.5) / columns as f64 * TAU;
            let light = cartesian(((low + high) / 2.0).acos(), phi);
            let area = (low - high) * TAU / columns as f64;
            shares[row / FINE * PHIS + column / FINE] += mixture.density(viewer, light) * area;
        }
    }
    shares
}

/// A shader that answers for a viewer and two numbers with a direction, or with its density.
fn shader(language: Language, name: &str, text: &str, is_density: bool) -> String {
    match language {
        Language::Glsl => {
            let value = if is_density {
                format!("vec4(drawn.w, {name}_pdf(drawn.xyz, viewer), 0.0, 1.0)")
            } else {
                "vec4(drawn.xyz, 1.0)".to_owned()
            };
            format!(
                "#version 300 es\n{text}uniform highp sampler2D pairs;\nout highp vec4 value;\n\
                 void main() {{\nint x = int(gl_FragCoord.x);\n\
                 vec3 viewer = texelFetch(pairs, ivec2(x, 0), 0).xyz;\n\
                 vec4 drawn = {name}_sample(viewer, texelFetch(pairs, ivec2(x, 1), 0).xy);\n\
                 value = {value};\n}}\n"
            )
        }
        _ => {
            let value = if is_density {
                format!("drawn.w, {name}_pdf(drawn.xyz, viewer), 0.0, 1.0")
            } else {
                "drawn.xyz, 1.0".to_owned()
            };
            format!(
                "{text}@group(0) @binding(0) var<storage, read_write> pairs: array<vec4<f32>>;\n\
                 @group(0) @binding(1) var<storage, read_write> values: array<vec4<f32>>;\n\
                 @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
                 let viewer = pairs[2u * id.x].xyz;\n\
                 let drawn = {name}_sample(viewer, pairs[2u * id.x + 1u].xy);\n\
                 values[id.x] = vec4<f32>({value});\n}}\n"
            )
        }
    }
}

#[test]
#[ignore = "needs Chromium"]
fn shaders_in_a_browser_draw_by_their_densities() {
    const DRAWS: usize = 1600;
    let Some(chromium) = chromium() else { return };
    let materials = materials();
    let mut jobs = Vec::new();
    for (name, model) in &materials {
        for language in [Language::Glsl, Language::Wgsl] {
            let text = source(model, language, name).unwrap();
            for is_density in [false, true] {
                let what = if is_density { "density" } else { "drawn" };
                jobs.push(serde_json::json!({
                    "language": language.name(), "name": format!("{name}-{what}"),
                    "text": shader(language, name, &text, is_density),
                }));
            }
        }
    }
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let corners: Vec<[[f64; 3]; 2]> = (0..VIEWS.len() * DRAWS)
        .map(|index| {
            let viewer = cartesian(VIEWS[index / DRAWS], 0.3);
            [viewer, [random.random(), random.random(), 0.0]]
        })
        .collect();
    let found = shader_values(&chromium, &jobs, &corners);
    let values = |label: &str| {
        found
            .iter()
            .find(|(l, _)| l == label)
            .map(|(_, values)| values)
    };
    let mut tested = 0;
    for (name, model) in &materials {
        let mixture = LobeMixture::of(model).unwrap();
        for language in ["glsl", "wgsl"] {
            let Some(drawn) = values(&format!("{language} {name}-drawn")) else {
                continue;
            };
            let densities = values(&format!("{language} {name}-density")).unwrap();
            for (view, (drawn, densities)) in
                drawn.chunks(DRAWS).zip(densities.chunks(DRAWS)).enumerate()
            {
                let viewer = cartesian(VIEWS[view], 0.3);
                let mut counts = vec![0.0; THETAS * PHIS];
                let mut worst = 0.0_f64;
                for (&light, density) in drawn.iter().zip(densities) {
                    counts[bin(light)] += 1.0;
                    assert!(
                        light[2] >= 0.0 && density[0] > 0.0,
                        "{name} {light:?} {density:?}"
                    );
                    let expected = mixture.density(viewer, light);
                    worst = worst.max((density[0] / expected - 1.0).abs());
                    worst = worst.max((density[1] / expected - 1.0).abs());
                }
                let (statistic, limit) = chi_square(&counts, &shares(&mixture, viewer));
                println!(
                    "{language} {name} at {}: densities off by {worst:.1e}, chi-square \
                     {statistic:.1} of {limit:.1}",
                    VIEWS[view]
                );
                assert!(
                    statistic < limit,
                    "{language} {name}: {statistic} of {limit}"
                );
                assert!(worst < 5e-3, "{language} {name}: {worst}");
                tested += 1;
            }
        }
    }
    assert!(tested >= materials.len() * VIEWS.len(), "only {tested} ran");
}
