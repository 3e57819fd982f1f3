//! What holds of pictures: closed forms, conservation of energy, savings that change nothing or
//! next to nothing, and scenes that cannot be.

use std::f64::consts::PI;
use std::path::Path;

use crate::networks::library;
use elm_brdf::render::{Bitmap, Optimizations, Options, Rendering, render};
use elm_brdf::scene_materials::Scene;
use elm_brdf::scenes::{NAMES, builtin};

fn picture(
    text: &str,
    savings: Optimizations,
    threads: usize,
) -> Result<Rendering, elm_brdf::Error> {
    let scene = Scene::parse(text, Path::new("tests/scene.toml"))?;
    let options = Options { savings, threads };
    Ok(render(&scene, &library(None), options, &|_, _| {})?)
}

fn head(width: u32, height: u32, more: &str) -> String {
    format!(
        "[image]\nwidth = {width}\nheight = {height}\n{more}\n\
         [camera]\nposition = [0, 0, 8]\ntarget = [0, 0, 0]\nheight = 2\n"
    )
}

const SPHERE: &str = "
[[sphere]]
center = [0, 0, 0]
radius = 1
material = 'm'
";

/// Everything at once: soft and hard shadows, a mesh, colours, two materials, two surfaces.
fn everything() -> String {
    "
[image]
width = 32
height = 24
samples = 16
depth = 2
[camera]
position = [0, 2, 7]
target = [0, 0.2, 0]
fov = 32
[material.red]
analytic = 'ggx'
albedo = 0.5
roughness = 0.4
specular = 0.1
tint = [0.9, 0.3, 0.2]
[material.learnt]
curet = '7'
[material.unused]
curet = '8'
[[sphere]]
center = [-0.8, 0, 0]
radius = 0.8
material = 'learnt'
[[mesh]]
file = 'data/octahedron.obj'
scale = 0.8
translate = [0.9, 0, 0.3]
material = 'red'
[[plane]]
point = [0, -0.8, 0]
normal = [0, 1, 0]
material = 'red'
[[directional]]
towards = [-1, 2, 1]
irradiance = [1, 1, 0.9]
[[point]]
position = [2, 2, 2]
intensity = [2, 2, 3]
[[point]]
position = [0, 500, 0]
intensity = [1, 1, 1]
[[area]]
corner = [-2, 2.5, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [2, 2, 2]
[environment]
builtin = 'studio'
radiance = [0.3, 0.3, 0.3]
"
    .to_owned()
}

#[test]
fn a_lambert_sphere_under_a_directional_light_is_albedo_over_pi_times_the_cosine() {
    let text = head(9, 9, "samples = 1024")
        + "[material.m]\nanalytic = 'lambert'\nalbedo = 0.6\n[[directional]]\n\
           towards = [0, 0, 1]\nirradiance = [2, 2, 2]\n"
        + SPHERE;
    let picture = picture(&text, Optimizations::LOSSLESS, 1).unwrap();
    // A pixel's mean of the cosine sqrt(1 - r^2), by the midpoint rule on 64 x 64 points.
    for (column, row) in [(4, 4), (2, 4), (6, 1), (0, 0)] {
        let mut expected = 0.0;
        for i in 0..64 {
            for j in 0..64 {
                let x = (f64::from(column) + (f64::from(i) + 0.5) / 64.0) / 4.5 - 1.0;
                let y = (f64::from(row) + (f64::from(j) + 0.5) / 64.0) / 4.5 - 1.0;
                expected += (1.0 - x * x - y * y).max(0.0).sqrt() / 4096.0;
            }
        }
        let expected = 0.6 / PI * 2.0 * expected;
        let found = picture.pixels[row as usize * 9 + column as usize][1];
        // 1024 Sobol points leave a smooth integrand at some 1/1024 of its range.
        assert!(
            (found - expected).abs() < 1e-3 * 0.4,
            "{column} {row}: {found} {expected}"
        );
    }
}

#[test]
fn a_lambert_plane_under_a_parallel_square_light_has_the_closed_form_irradiance() {
    // The camera looks from below the light at the point under its centre; see the configuration
    // factor in the tests of lights: four corners with a = b = 1/4.
    let a = 0.25_f64;
    let root = (1.0 + a * a).sqrt();
    let factor = 4.0 * (2.0 * a / root * (a / root).atan()) / (2.0 * PI);
    let text = "
[image]
width = 1
height = 1
samples = 4096
[camera]
position = [3, 1, 0]
target = [0, 0, 0]
height = 1e-6
[material.m]
analytic = 'lambert'
albedo = 0.5
[[plane]]
point = [0, 0, 0]
normal = [0, 1, 0]
material = 'm'
[[area]]
corner = [-0.5, 2, -0.5]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [3, 3, 3]
";
    let found = picture(text, Optimizations::LOSSLESS, 1).unwrap().pixels[0][0];
    let expected = 0.5 * 3.0 * factor;
    assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
}

#[test]
fn in_a_white_furnace_a_white_surface_disappears() {
    let text = head(24, 24, "samples = 64")
        + "[material.m]\nanalytic = 'lambert'\nalbedo = 1\n[environment]\n"
        + SPHERE;
    let picture = picture(&text, Optimizations::LOSSLESS, 2).unwrap();
    // With r the ratio of the density of the light's samples, which is the integrand itself, to
    // that of the material's, a sample is r^2 / (1 + r^2) from the one way and r' / (1 + r'^2)
    // from the other: between 0 and 1.5 with mean 1, so its deviation is at most sqrt(1 * 0.5).
    let five_deviations = |samples: f64| 5.0 * (0.5 / samples).sqrt();
    let values = picture.pixels.iter().map(|pixel| pixel[0]);
    assert!(
        values
            .clone()
            .all(|v| (v - 1.0).abs() < five_deviations(64.0))
    );
    let mean = values.sum::<f64>() / 576.0;
    assert!((mean - 1.0).abs() < five_deviations(576.0 * 64.0), "{mean}");
}

#[test]
fn several_bounces_between_white_walls_conserve_energy() {
    // In a furnace each bounce off albedo 0.5 halves what is left: a closed sphere seen from
    // within, its wall an environment by itself, cannot be lit; so a convex pair does it. A plane
    // below a sphere sees sky or sphere; with white surfaces and many bounces both look like sky.
    let text = head(8, 8, "samples = 256\ndepth = 64")
        + "[material.m]\nanalytic = 'lambert'\nalbedo = 1\n[environment]\n\
           [[plane]]\npoint = [0, -1, 0]\nnormal = [0, 1, 0]\nmaterial = 'm'\n"
        + SPHERE;
    let picture = picture(&text, Optimizations::LOSSLESS, 2).unwrap();
    let mean = picture.pixels.iter().map(|p| p[0]).sum::<f64>() / 64.0;
    // Russian roulette adds noise; 16384 paths of relative deviation below 1 leave 3 / 128.
    assert!((mean - 1.0).abs() < 3.0 / 128.0, "{mean}");
}

#[test]
fn lossless_savings_give_the_same_picture_bit_for_bit_on_any_number_of_threads() {
    let reference = picture(&everything(), Optimizations::NONE, 1).unwrap();
    assert!(reference.pixels.iter().flatten().all(|v| v.is_finite()));
    for threads in [1, 3] {
        let saved = picture(&everything(), Optimizations::LOSSLESS, threads).unwrap();
        assert_eq!(saved.pixels, reference.pixels);
        assert!(saved.account.done.evaluations * 2 < reference.account.done.evaluations);
    }
    for name in Optimizations::NAMES {
        let savings = Optimizations::LOSSLESS.without(name).unwrap();
        if savings == Optimizations::LOSSLESS {
            continue;
        }
        let without = picture(&everything(), savings, 2).unwrap();
        assert_eq!(without.pixels, reference.pixels, "{name}");
    }
}

#[test]
fn all_savings_stay_within_half_a_display_step_on_average_and_two_at_most() {
    // The command of docs/reports/rendering.md holds the built-in scenes' own sizes to it.
    for (name, (width, height)) in
        NAMES
            .into_iter()
            .zip([(240, 135), (160, 120), (200, 120), (40, 30)])
    {
        let mut sheet = builtin(name, None).unwrap();
        sheet.resize(width, height);
        let render = |savings| {
            let options = Options {
                savings,
                threads: 0,
            };
            sheet.render(&library(None), options, &|_, _| {}).unwrap()
        };
        let (brute, saved) = (render(Optimizations::NONE), render(Optimizations::ALL));
        let evaluations = |rendering: &Rendering| rendering.account.done.evaluations;
        assert!(evaluations(&saved) < evaluations(&brute), "{name}");
        steps_apart(&Bitmap::display(&brute), &Bitmap::display(&saved), name);
    }
    let render = |savings| Bitmap::display(&picture(&everything(), savings, 0).unwrap());
    steps_apart(
        &render(Optimizations::NONE),
        &render(Optimizations::ALL),
        "everything",
    );
}

fn steps_apart(a: &Bitmap, b: &Bitmap, name: &str) {
    let steps: Vec<u8> = a
        .bytes()
        .iter()
        .zip(b.bytes())
        .map(|(a, b)| a.abs_diff(*b))
        .collect();
    let mean = steps.iter().map(|&s| f64::from(s)).sum::<f64>() / steps.len() as f64;
    let most = steps.iter().max().unwrap();
    assert!(
        mean <= 0.5 && *most <= 2,
        "{name}: mean {mean}, most {most}"
    );
}

#[test]
fn of_61_materials_only_the_3_that_are_seen_are_made() {
    let mut text = head(48, 16, "samples = 4") + "[[directional]]\ntowards = [0, 0, 1]\n";
    for id in 1..=61 {
        text += &format!("[material.m{id}]\ncuret = '{id}'\n");
    }
    for (id, x) in [(5, -2.0), (20, 0.0), (33, 2.0)] {
        text += &format!("[[sphere]]\ncenter = [{x}, 0, 0]\nradius = 0.9\nmaterial = 'm{id}'\n");
    }
    // Hidden behind the sphere in the middle.
    text += "[[sphere]]\ncenter = [0, 0, -3]\nradius = 0.5\nmaterial = 'm40'\n";
    let account = picture(&text, Optimizations::ALL, 2).unwrap().account;
    let used: Vec<&str> = account.materials_used.keys().map(String::as_str).collect();
    assert_eq!(
        (account.materials_defined, used),
        (61, vec!["m20", "m33", "m5"])
    );
}

#[test]
fn a_light_inside_a_sphere_lights_nothing_outside() {
    let text = head(9, 9, "samples = 4")
        + "[material.m]\nanalytic = 'lambert'\n[[point]]\nposition = [0, 0, 0]\n[[area]]\n\
           corner = [-0.1, -0.1, 0.1]\nedge_u = [0.2, 0, 0]\nedge_v = [0, 0.2, 0]\n"
        + SPHERE;
    let picture = picture(&text, Optimizations::ALL, 1).unwrap();
    assert!(picture.pixels.iter().flatten().all(|&v| v == 0.0));
}

#[test]
fn impossible_scenes_are_errors_of_one_line_that_name_the_place() {
    let material = "[material.m]\nanalytic = 'lambert'\n";
    let with = |image: &str, rest: &str| head(4, 4, image) + material + rest;
    // Without a light no material would be needed, and none looked at.
    let lit = format!("[[directional]]\ntowards = [0, 0, 1]\n{SPHERE}");
    let table = [
        ("".to_owned(), "missing field `image`"),
        (
            "[image]\nwidth = 4\n[image".to_owned(),
            "scene.toml, line 3: ",
        ),
        (
            with("", "[[sphere]]\ncenter = [0, 0]\n"),
            "scene.toml, line 12: ",
        ),
        (with("samplez = 3", ""), "line 4: unknown field `samplez`"),
        (
            with("", &SPHERE.replace("'m'", "'felt'")),
            "line 15: unknown material 'felt'",
        ),
        (
            with("", &SPHERE.replace("radius = 1", "radius = nan")),
            "radius is NaN",
        ),
        (
            with("", &SPHERE.replace("radius = 1", "radius = -1")),
            "radius is -1",
        ),
        (
            with("", &SPHERE.replace("[0, 0, 0]", "[inf, 0, 0]")),
            "center is [inf, 0.0, 0.0]",
        ),
        (
            with(
                "",
                "[[point]]\nposition = [0, 0, 0]\nintensity = [-1, 0, 0]",
            ),
            "intensity is [-1.0",
        ),
        (
            with("", "[[directional]]\ntowards = [0, 0, 0]"),
            "towards is [0.0, 0.0, 0.0]",
        ),
        (
            with("", "[[mesh]]\nfile = 'no.obj'\nmaterial = 'm'"),
            "no.obj: ",
        ),
        (with("", "[environment]\nfile = 'no.exr'"), "no.exr: "),
        (with("samples = 0", ""), "image.samples is 0"),
        (with("samples = 100000", ""), "100000 samples per pixel"),
        (with("exposure = nan", ""), "image.exposure is NaN"),
        (head(0, 4, ""), "the image size is 0 x 4"),
        (
            head(4_000_000_000, 4_000_000_000, ""),
            "16000000000000000000 pixels",
        ),
        (
            with("", &lit).replace("analytic = 'lambert'", "curet = '62'"),
            "material 'm': ",
        ),
        (
            with("", &lit).replace("analytic = 'lambert'", "curet = '1'\ncsv = 'a.csv'"),
            "expected exactly one of",
        ),
        (
            with("", &lit).replace("'lambert'", "'phong'"),
            "unknown formula 'phong'",
        ),
        (
            with("", &lit).replace("'lambert'", "'ggx'\nroughness = 0"),
            "roughness is 0",
        ),
        (
            with("", &"[[point]]\nposition = [0, 0, 0]\n".repeat(70_000)),
            "70000 lights",
        ),
    ];
    for (text, part) in table {
        let error = picture(&text, Optimizations::ALL, 1)
            .unwrap_err()
            .to_string();
        assert!(error.contains(part), "expected '{part}' in '{error}'");
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn an_encoded_picture_is_read_back() {
    let picture = picture(&(head(4, 4, "") + "[environment]\n"), Optimizations::ALL, 1).unwrap();
    for name in ["a.png", "a.exr"] {
        let format = Rendering::format(Path::new(name)).unwrap();
        let read = image::load_from_memory_with_format(&picture.encode(format).unwrap(), format);
        let read = read.unwrap();
        assert_eq!((read.width(), read.height()), (4, 4));
        assert!((read.into_rgb32f().get_pixel(1, 1)[0] - 1.0).abs() < 1e-6);
    }
    assert!(Rendering::format(Path::new("a.jpeg")).is_err());
}
