//! What holds of every fitted material that is sampled: directions follow their density, the
//! albedo is the same whichever way it is found, and light made of nothing is reported.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::networks::library;
use elm::{Activation, ElmParams, solve::Ridge};
use elm_brdf::features::Features;
use elm_brdf::fit::Fit;
use elm_brdf::model::BrdfParams;
use elm_brdf::registry;
use elm_brdf::render::{Material, MaterialLoader, Optimizations, Options, render, testing};
use elm_brdf::scene_materials::{MaterialTable, Scene, SceneMaterialLoader};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::curet::MATERIALS;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::lobes::Formula;
use elm_datasets::merl::Merl;
use elm_datasets::{Brdf, Invalid, MaterialId, synthetic};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Models of every third material of CUReT's files, or of the synthetic data, with their numbers.
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

/// Fitted to the synthetic data, by the usual recipe.
static SYNTHETIC: LazyLock<Vec<(usize, Material)>> = LazyLock::new(|| fitted(None));

/// Fitted to CUReT's files; `None` where these are not found.
static CURET: LazyLock<Option<Vec<(usize, Material)>>> =
    LazyLock::new(|| elm_test_support::curet().map(|dir| fitted(Some(&dir))));

/// Independent numbers in \[0, 1).
fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move || random.random()
}

/// Viewing angles from the normal to next to grazing.
const VIEWS: [f64; 4] = [0.0, 0.5, 1.2, 1.55];

fn draws_follow_their_density(materials: &[(usize, Material)]) {
    let mut random = uniform(1);
    for (id, material) in materials {
        for view in VIEWS {
            let found = testing::chi_square(material, cartesian(view, 0.3), &mut random);
            assert!(found.statistic < found.limit, "{id} at {view}: {found:?}");
            // Midpoints at a tenth of the narrowest lobe's width.
            assert!(
                (found.total - 1.0).abs() < 2e-3,
                "{id} at {view}: {found:?}"
            );
            assert!(found.density_error < 1e-6, "{id} at {view}: {found:?}");
        }
    }
}

#[test]
fn directions_drawn_from_every_fitted_material_follow_their_density_by_the_chi_square_test() {
    draws_follow_their_density(&SYNTHETIC);
}

#[test]
#[ignore = "needs data: CUReT"]
fn directions_drawn_from_every_measured_material_follow_their_density_by_the_chi_square_test() {
    draws_follow_their_density(CURET.as_deref().unwrap_or_default());
}

fn albedos_agree(materials: &[(usize, Material)]) {
    let mut random = uniform(2);
    let (mut above, mut most): (Vec<usize>, f64) = (Vec::new(), 0.0);
    for (id, material) in materials {
        for (theta_o, albedo) in material.albedo() {
            let azimuths = if material.is_isotropic() { 1 } else { 8 };
            let (mut mean, mut bound) = (0.0, 0.0);
            for azimuth in 0..azimuths {
                let turn = TAU * f64::from(azimuth) / f64::from(azimuths);
                let outgoing = cartesian(theta_o, turn);
                let found = testing::white_furnace(material, outgoing, &mut random).unwrap();
                let quadrature = found.quadrature;
                // Five deviations, and one part in a hundred for the quadrature.
                let tolerance = 5.0 * found.standard_error + 0.01 * quadrature;
                assert!(
                    (found.sampled - quadrature).abs() <= tolerance,
                    "{id} at {theta_o}: {found:?}"
                );
                mean += quadrature / f64::from(azimuths);
                bound += tolerance / f64::from(azimuths);
                most = most.max(quadrature);
            }
            // As many draws as one of these, but of a sequence that fills the square evenly.
            assert!(
                (albedo - mean).abs() <= bound,
                "{id} at {theta_o}: {albedo}, {mean}"
            );
        }
        if material.largest_albedo() > 1.0 {
            above.push(*id);
        }
    }
    println!("largest albedo {most:.3}; above 1: {above:?}");
}

#[test]
fn in_a_white_furnace_every_fitted_material_sends_its_albedo_whichever_way_it_is_found() {
    albedos_agree(&SYNTHETIC);
}

#[test]
#[ignore = "needs data: CUReT"]
fn in_a_white_furnace_every_measured_material_sends_its_albedo_whichever_way_it_is_found() {
    albedos_agree(CURET.as_deref().unwrap_or_default());
}

/// Directions that are as likely anywhere above the surface.
fn anywhere(count: usize) -> Vec<DirectionPair> {
    let mut random = uniform(3);
    let mut direction = || cartesian(random().acos(), random() * TAU);
    (0..count)
        .map(|_| DirectionPair {
            incident: direction(),
            outgoing: direction(),
        })
        .collect()
}

/// One of every implementation of `Brdf`: closed forms, a measured table, every baseline, and
/// networks; and whether it is reciprocal by construction.
fn every_kind() -> Vec<(String, Box<dyn Brdf>, bool)> {
    let lambert = || Formula::lambert(0.4).unwrap();
    let oren_nayar = || Formula::oren_nayar(0.4, 0.5).unwrap();
    let table = Merl::from_fn(|directions| {
        let value = lambert().with_ggx(0.3, 0.3).unwrap().at(directions);
        [value, 0.5 * value, 0.1]
    });
    let mut kinds: Vec<(String, Box<dyn Brdf>, bool)> = vec![
        ("lambert".to_owned(), Box::new(lambert()), true),
        ("oren-nayar".to_owned(), Box::new(oren_nayar()), true),
        (
            "ward".to_owned(),
            Box::new(oren_nayar().with_ward(0.2, 0.2).unwrap()),
            true,
        ),
        (
            "ggx".to_owned(),
            Box::new(lambert().with_ggx(0.04, 0.2).unwrap()),
            true,
        ),
        ("merl".to_owned(), Box::new(table), false),
    ];
    let id = MaterialId::new(7).unwrap();
    let data = synthetic::measurements(1, &[id], Invalid::Clamp);
    let samples = data.samples(0).unwrap();
    let pairs = &samples.directions;
    // One of each kind; they differ in inputs and targets only.
    let mut missing = vec![
        "phong",
        "blinn-phong",
        "lafortune-2",
        "koenderink-8",
        "nearest",
        "thin-plate",
        "gaussian-process",
    ];
    for reference in registry::baselines() {
        let Some(index) = missing.iter().position(|name| *name == reference.name) else {
            continue;
        };
        missing.remove(index);
        let name = reference.full_name();
        let method = reference.with_row_limit(1).method;
        let model = method.fit(pairs, samples.values.view()).unwrap();
        kinds.push((name, Box::new(model), false));
    }
    assert!(missing.is_empty(), "{missing:?}");
    for features in Features::ALL {
        let params = BrdfParams {
            features,
            transform: TargetTransform::default_log(),
            network: ElmParams::new(40)
                .with_activation(Activation::Tanh)
                .with_solver(Ridge::leave_one_out()),
        };
        let model = params.fit(pairs, samples.values.view()).unwrap();
        let name = format!("elm ({})", features.name());
        kinds.push((name, Box::new(model), features.is_reciprocal()));
    }
    kinds
}

#[test]
fn every_kind_of_reflectance_passes_chi_square_white_furnace_and_where_it_claims_it_reciprocity() {
    let mut random = uniform(4);
    let pairs = anywhere(500);
    for (name, brdf, reciprocal) in every_kind() {
        let difference = testing::reciprocity(&*brdf, &pairs).unwrap();
        println!("{name}: reciprocal to {difference:.1e}");
        if reciprocal {
            assert!(difference < 1e-9, "{name}: {difference:e}");
        }
        let material = Material::new(brdf, [1.0; 3], false).unwrap();
        for view in [0.0, 0.6, 1.3] {
            let outgoing = cartesian(view, 0.3);
            let fit = testing::chi_square(&material, outgoing, &mut random);
            assert!(fit.statistic < fit.limit, "{name} at {view}: {fit:?}");
            assert!((fit.total - 1.0).abs() < 2e-3, "{name} at {view}: {fit:?}");
            assert!(fit.density_error < 1e-6, "{name} at {view}: {fit:?}");
            let found = testing::white_furnace(&material, outgoing, &mut random).unwrap();
            let tolerance = 5.0 * found.standard_error + 0.01 * found.quadrature;
            assert!(
                (found.sampled - found.quadrature).abs() <= tolerance,
                "{name} at {view}: {found:?}"
            );
        }
    }
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
center = [0, 0, 0]
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
center = [0, 0, 0]
radius = 1
material = 'm'
"
        );
        let scene = Scene::parse(&text, Path::new("scene.toml")).unwrap();
        render(&scene, &library(None), Options::default(), &|_, _| {}).unwrap()
    };
    let (as_it_is, rescaled) = (picture(""), picture("conserve_energy = true"));
    let [value, less] = [&as_it_is, &rescaled].map(|picture| picture.pixels[0][0]);
    // Lambert's 1, and of what meets the highlight 0.916 (its directional albedo by an independent sum).
    assert!(value > 1.8, "{value}");
    // At 87 degrees the highlight's directional albedo is 0.931, and the sum the largest. Half a percent for
    // the draws of the material's albedo and the pixel's.
    assert!((less - 1.916 / 1.931).abs() < 0.005, "{less}");
    let notes = [&as_it_is, &rescaled].map(|picture| picture.account.notes.join("\n"));
    for note in &notes {
        assert!(note.starts_with("material 'm' reflects up to "), "{note}");
    }
    assert!(!notes[0].contains("rescaled"), "{}", notes[0]);
    assert!(notes[1].ends_with(", rescaled to 1"), "{}", notes[1]);
}
