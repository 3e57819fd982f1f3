//! What holds of every fitted material that is sampled: directions follow their density, the
//! albedo is the same whichever way it is found, and light made of nothing is reported.

// What was skipped is for whoever runs the tests by hand.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

#[path = "support/networks.rs"]
mod networks;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use elm_brdf::render::{Material, MaterialLoader, Optimizations, Options, render};
use elm_brdf::scene_materials::{MaterialTable, Scene, SceneMaterialLoader};
use elm_datasets::curet::MATERIALS;
use elm_datasets::geometry::{DirectionPair, cartesian};
use networks::library;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Models of every third material of CUReT's files, or of the stand-in, with their numbers.
fn fitted(curet: Option<&Path>) -> Vec<(usize, Material)> {
    let library = SceneMaterialLoader::new(curet.map(PathBuf::from));
    (1..=MATERIALS)
        .step_by(3)
        .map(|id| {
            let asked = MaterialTable {
                curet: Some(format!("{id}")),
                ..MaterialTable::default()
            };
            let loaded = library.load(&asked, Path::new("")).unwrap();
            let material = Material::new(loaded.brdf, [1.0; 3], false).unwrap();
            (id, material)
        })
        .collect()
}

/// Fitted to the stand-in, by the usual recipe.
static STAND_IN: LazyLock<Vec<(usize, Material)>> = LazyLock::new(|| fitted(None));

/// Fitted to CUReT's files; none where these are not found.
static CURET: LazyLock<Vec<(usize, Material)>> = LazyLock::new(|| {
    let shared = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let root = std::env::var_os("ELM_BRDF_DATA").map_or_else(shared, PathBuf::from);
    let folders = [root.join("curet"), root];
    let found = folders.iter().find(|dir| dir.join("abrdf.dat").is_file());
    found.map_or_else(
        || {
            println!("skipped: no CUReT files in ELM_BRDF_DATA or ../shared");
            Vec::new()
        },
        |dir| fitted(Some(dir)),
    )
});

/// Viewing angles from the normal to next to grazing.
const VIEWS: [f64; 4] = [0.0, 0.5, 1.2, 1.55];

#[test]
fn directions_drawn_from_every_fitted_material_follow_their_density_by_the_chi_square_test() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (id, material) in STAND_IN.iter().chain(&*CURET) {
        for view in VIEWS {
            let (statistic, limit) = chi_square(material, view, &mut random);
            assert!(
                statistic < limit,
                "{id}: {statistic} passes {limit} at {view}"
            );
        }
    }
}

/// The statistic of directions drawn for a view, and what it may be.
fn chi_square(material: &Material, view: f64, random: &mut ChaCha8Rng) -> (f64, f64) {
    const THETAS: usize = 6;
    const PHIS: usize = 8;
    // A tenth by the cosine is at least four in the emptiest bin, at the horizon.
    const DRAWS: usize = 5000;
    // Steps of the density within a bin; the density is constant on each.
    const FINE: usize = 4;
    const FINE_PHIS: usize = 8;
    let outgoing = cartesian(view, 0.3);
    let mut counts = [0.0; THETAS * PHIS];
    for _ in 0..DRAWS {
        let (w, density) = material.sample(outgoing, [random.random(), random.random()]);
        assert!((material.pdf(outgoing, w) / density - 1.0).abs() < 1e-6);
        let theta = w[2].acos() / FRAC_PI_2 * THETAS as f64;
        let phi = (w[1].atan2(w[0]) - 0.3).rem_euclid(TAU) / TAU * PHIS as f64;
        counts[(theta as usize).min(THETAS - 1) * PHIS + (phi as usize).min(PHIS - 1)] += 1.0;
    }
    let mut statistic = 0.0;
    let mut total = 0.0;
    for (bin, count) in counts.iter().enumerate() {
        let mut expected = 0.0;
        for t in 0..FINE {
            let theta =
                |t: usize| (bin / PHIS * FINE + t) as f64 / (THETAS * FINE) as f64 * FRAC_PI_2;
            let (near, far) = (theta(t).cos(), theta(t + 1).cos());
            for p in 0..FINE_PHIS {
                let steps = (PHIS * FINE_PHIS) as f64;
                let phi = ((bin % PHIS * FINE_PHIS + p) as f64 + 0.5) / steps * TAU;
                let incident = cartesian(((near + far) / 2.0).acos(), phi + 0.3);
                let area = (near - far) * TAU / steps;
                expected += material.pdf(outgoing, incident) * area;
            }
        }
        total += expected;
        let expected = expected * DRAWS as f64;
        statistic += (count - expected) * (count - expected) / expected;
    }
    assert!(
        (total - 1.0).abs() < 1e-9,
        "the density integrates to {total}"
    );
    // Wilson and Hilferty's approximation: the cube root of chi-square over its degrees of
    // freedom is normal. Five deviations are passed once in three million.
    let freedom = (THETAS * PHIS - 1) as f64;
    let spread = 2.0 / (9.0 * freedom);
    (
        statistic,
        freedom * (1.0 - spread + 5.0 * spread.sqrt()).powi(3),
    )
}

/// What a surface sends towards `outgoing` where light of radiance 1 comes from everywhere: by
/// quadrature, and by sampling with its standard error.
fn furnace(material: &Material, theta_o: f64, random: &mut ChaCha8Rng) -> (f64, f64, f64) {
    const DRAWS: usize = 1000;
    const THETAS: usize = 90;
    const PHIS: usize = 36;
    let outgoing = cartesian(theta_o, 0.0);
    let luminance = |pairs: &[DirectionPair]| -> Vec<f64> {
        let values = material.eval(pairs).unwrap();
        let luminance = |f: &[f64; 3]| 0.2126 * f[0] + 0.7152 * f[1] + 0.0722 * f[2];
        values.iter().map(luminance).collect()
    };
    // Midpoints in both angles, of one half: cells of a degree, as lobes are narrow.
    let step = FRAC_PI_2 / THETAS as f64;
    let (mut pairs, mut areas) = (Vec::new(), Vec::new());
    for i in 0..THETAS {
        let theta = (i as f64 + 0.5) * step;
        for j in 0..PHIS {
            let incident = cartesian(theta, (j as f64 + 0.5) / PHIS as f64 * PI);
            pairs.push(DirectionPair { incident, outgoing });
            areas.push(theta.sin() * theta.cos() * step * TAU / PHIS as f64);
        }
    }
    let values = luminance(&pairs);
    let quadrature: f64 = values
        .iter()
        .zip(areas)
        .map(|(value, area)| value * area)
        .sum();
    let (pairs, factors): (Vec<DirectionPair>, Vec<f64>) = (0..DRAWS)
        .map(|_| {
            let drawn = material.sample(outgoing, [random.random(), random.random()]);
            let (incident, density) = drawn;
            (DirectionPair { incident, outgoing }, incident[2] / density)
        })
        .unzip();
    let weights: Vec<f64> = luminance(&pairs)
        .iter()
        .zip(factors)
        .map(|(value, factor)| value * factor)
        .collect();
    let n = DRAWS as f64;
    let mean = weights.iter().sum::<f64>() / n;
    let variance = weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (quadrature, mean, (variance / n).sqrt())
}

#[test]
fn in_a_white_furnace_every_fitted_material_sends_its_albedo_whichever_way_it_is_found() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut above, mut most): (Vec<usize>, f64) = (Vec::new(), 0.0);
    for (id, material) in STAND_IN.iter().chain(&*CURET) {
        for (theta_o, tabulated) in material.albedo() {
            let (quadrature, mean, deviation) = furnace(material, theta_o, &mut random);
            // Five deviations, and one part in a hundred for the quadrature.
            let tolerance = 5.0 * deviation + 0.01 * quadrature;
            assert!(
                (mean - quadrature).abs() <= tolerance,
                "{id} at {theta_o}: {mean} by sampling, {quadrature}"
            );
            // The table has 24 x 32 cells.
            assert!(
                (tabulated - quadrature).abs() <= 0.03 * quadrature,
                "{id} at {theta_o}: {tabulated} in the table, {quadrature}"
            );
            most = most.max(quadrature);
        }
        if material.largest_albedo() > 1.0 {
            above.push(*id);
        }
    }
    println!("largest albedo {most:.3}; above 1: {above:?}");
}

#[test]
fn in_a_furnace_a_learnt_sphere_shows_its_albedo() {
    let text = "
[image]
width = 16
height = 16
samples = 256
[camera]
position = [0, 0, 8]
target = [0, 0, 0]
height = 2
[material.m]
curet = '7'
[environment]
[[sphere]]
centre = [0, 0, 0]
radius = 1
material = 'm'
";
    let scene = Scene::parse(text, Path::new("scene.toml")).unwrap();
    let options = Options {
        savings: Optimizations::LOSSLESS,
        threads: 2,
    };
    let library = library(None);
    let picture = render(&scene, &library, options, &|_, _| {}).unwrap();
    let asked = MaterialTable {
        curet: Some("7".to_owned()),
        ..MaterialTable::default()
    };
    let loaded = library.load(&asked, Path::new("")).unwrap();
    let material = Material::new(loaded.brdf, [1.0; 3], false).unwrap();
    // The pixel beside the middle sees the sphere at 1/16 to 2/16 of its radius on both axes.
    let near_normal = material.albedo()[1].1;
    let pixel = picture.pixels[8 * 16 + 8];
    let found = 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2];
    assert!(
        (found / near_normal - 1.0).abs() < 0.03,
        "{found} {near_normal}"
    );
}

#[test]
fn a_model_that_makes_light_of_nothing_is_reported_and_rescaled_only_when_asked() {
    // White below, and a mirror-like highlight above that takes nothing from it.
    let picture = |more: &str| {
        let text = format!(
            "
[image]
width = 1
height = 1
samples = 4096
[camera]
position = [0, 0, 8]
target = [0, 0, 0]
height = 0.01
[material.m]
analytic = 'ggx'
albedo = 1
specular = 1
roughness = 0.25
{more}
[environment]
[[sphere]]
centre = [0, 0, 0]
radius = 1
material = 'm'
"
        );
        let scene = Scene::parse(&text, Path::new("scene.toml")).unwrap();
        render(&scene, &library(None), Options::default(), &|_, _| {}).unwrap()
    };
    let (as_it_is, rescaled) = (picture(""), picture("conserve_energy = true"));
    let [value, less] = [&as_it_is, &rescaled].map(|picture| picture.pixels[0][0]);
    // Lambert's 1, and of what meets the highlight 0.92 (its directional albedo by an independent sum).
    assert!(value > 1.8, "{value}");
    // By a table of albedos, the pixel by 4096 samples.
    assert!((less - 1.0).abs() < 0.01, "{less}");
    let notes = [&as_it_is, &rescaled].map(|picture| picture.account.notes.join("\n"));
    for note in &notes {
        assert!(note.starts_with("material 'm' reflects up to "), "{note}");
    }
    assert!(!notes[0].contains("rescaled"), "{}", notes[0]);
    assert!(notes[1].ends_with(", rescaled to 1"), "{}", notes[1]);
}
