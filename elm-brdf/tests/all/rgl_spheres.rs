//! Spheres of the RGL materials against the reference pictures in `rgl/`, as that folder's README
//! describes; skipped where it is not there.

use std::path::Path;

use elm_brdf::render::{Options, Rendering, render};
use elm_brdf::scene_materials::{Scene, SceneMaterialLoader};

/// Luminance of linear sRGB.
fn luminance(pixel: &[f64; 3]) -> f64 {
    0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2]
}

fn srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// PSNR in dB over the sphere's pixels, both pictures scaled so that the 95th percentile of the
/// reference's luminance over its lit pixels becomes 0.8.
fn psnr(picture: &[[f64; 3]], reference: &[[f64; 3]]) -> f64 {
    let mut lit: Vec<f64> = reference
        .iter()
        .map(luminance)
        .filter(|&l| l > 0.0)
        .collect();
    lit.sort_by(f64::total_cmp);
    // By linear interpolation between order statistics.
    let at = 0.95 * (lit.len() - 1) as f64;
    let (below, part) = (at as usize, at.fract());
    let percentile = lit[below] * (1.0 - part) + lit[below + 1] * part;
    let scale = 0.8 / percentile;
    let (mut sum, mut count) = (0.0, 0.0);
    for (index, (p, q)) in picture.iter().zip(reference).enumerate() {
        let center = |k: usize| (k as f64 + 0.5) / 128.0 - 1.0;
        let (x, y) = (center(index % 256), center(index / 256));
        if x * x + y * y < 1.0 {
            for channel in 0..3 {
                sum += (srgb(scale * p[channel]) - srgb(scale * q[channel])).powi(2);
                count += 1.0;
            }
        }
    }
    -10.0 * (sum / count).log10()
}

/// The sphere of the references, of a material in this folder, an evaluation at the centre of each pixel.
pub(crate) fn sphere(folder: &Path, material: &str) -> Rendering {
    let text = format!(
        "[image]
width = 256
height = 256
samples = 1
[camera]
position = [0, 0, 5]
target = [0, 0, 0]
height = 2
[material.m]
{material}
[[sphere]]
center = [0, 0, 0]
radius = 1
material = 'm'
[[directional]]
towards = [-1, 1, 1]
irradiance = [1, 1, 1]
"
    );
    let scene = Scene::parse(&text, &folder.join("scene.toml")).unwrap();
    let library = SceneMaterialLoader::new(None);
    render(&scene, &library, Options::default(), &|_, _| {}).unwrap()
}

#[test]
#[ignore = "needs data: rgl"]
fn learnt_spheres_look_more_like_the_measured_ones_than_nbrdfs() {
    let Some(data) = elm_test_support::folder("rgl") else {
        return;
    };
    // NBRDF's figures are those of the README.
    for (material, nbrdf) in [
        ("cc_iris_purple_gem_rgb", 20.1),
        ("paper_white_rgb", 32.2),
        ("vch_golden_yellow_rgb", 28.1),
    ] {
        let picture = image::open(data.join(format!("{material}_sphere.exr"))).unwrap();
        let reference: Vec<[f64; 3]> = picture
            .into_rgb32f()
            .pixels()
            .map(|p| p.0.map(f64::from))
            .collect();
        let score = |fit: &str| {
            let subject = format!("csv = '{material}_train.csv'\n{fit}");
            psnr(&sphere(&data, &subject).pixels, &reference)
        };
        let (large, small) = (score("neurons = 256"), score("neurons = 64"));
        let ggx = score("fit = 'ggx+lambert'");
        println!(
            "{material}: 256 neurons {large:.1} dB, 64 {small:.1}, GGX {ggx:.1}, NBRDF {nbrdf}"
        );
        assert!(large >= nbrdf + 3.0, "{material}: {large} dB");
        assert!(small >= nbrdf + 1.5, "{material}: {small} dB");
    }
}
