//! What pictures cost: how the time grows with pixels, lights and threads, and what the savings
//! save on each built-in scene.
//!
//! ```text
//! cargo run --release -p elm-brdf --example render_costs -- [CURET_FOLDER]
//! ```
//!
//! Times of growth are medians of three, those of savings single, on one thread; without a folder
//! the synthetic data is used. Materials are made once and prepared for every picture, which has a
//! column of its own; nanoseconds are those of the rest.

// A program for a terminal.
#![allow(clippy::print_stdout)]

use std::path::PathBuf;
use std::time::Instant;

use elm_brdf::render::{Bitmap, Optimizations, Options, Rendering};
use elm_brdf::scene_materials::{Scene, SceneMaterialLoader, Sheet};
use elm_brdf::scenes::{NAMES, builtin};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let library = SceneMaterialLoader::new(std::env::args_os().nth(1).map(PathBuf::from));
    growth(&library)?;
    savings(&library, None)?;
    savings(&library, Some((320, 180)))
}

/// A render and the median of the seconds that `times` of it took.
fn timed(
    times: usize,
    sheet: &Sheet,
    library: &SceneMaterialLoader,
    options: Options,
) -> Outcome<(Rendering, f64)> {
    let mut seconds = Vec::new();
    let mut last = None;
    for _ in 0..times {
        let start = Instant::now();
        last = Some(sheet.render(library, options, &|_, _| {})?);
        seconds.push(start.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    Ok((last.ok_or("nothing rendered")?, seconds[times / 2]))
}

/// A row of learnt spheres under `count` lights.
fn lights(count: usize, width: u32, height: u32) -> Outcome<Sheet> {
    let mut text = format!(
        "[image]\nwidth = {width}\nheight = {height}\nsamples = 4\n\
         [camera]\nposition = [0, 0, 8]\ntarget = [0, 0, 0]\nheight = 2.2\n\
         [material.m]\ncuret = '39'\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n"
    );
    for light in 0..count {
        let angle = light as f64;
        let (x, y) = (angle.cos(), angle.sin());
        text +=
            &format!("[[directional]]\ntowards = [{x}, {y}, 1.5]\nirradiance = [0.3, 0.3, 0.3]\n");
    }
    Ok(Scene::parse(&text, "lights".as_ref())?.into())
}

fn growth(library: &SceneMaterialLoader) -> Outcome<()> {
    let options = Options {
        savings: Optimizations::LOSSLESS,
        threads: 1,
    };
    println!(
        "pixels  lights  threads  seconds  of materials  evaluations  ns per pixel sample and light"
    );
    lights(1, 1, 1)?.render(library, options, &|_, _| {})?;
    let row = |sheet: &Sheet, count: usize, options: Options| -> Outcome<f64> {
        let (picture, seconds) = timed(3, sheet, library, options)?;
        let pixels = picture.pixels.len();
        let threads = options.threads;
        let materials = picture.account.seconds.materials;
        let each = (seconds - materials) * 1e9 / (4 * pixels * count) as f64;
        let evaluations = picture.account.done.evaluations;
        println!(
            "{pixels:>6} {count:>7} {threads:>8} {seconds:>8.3} {materials:>13.3} {evaluations:>12} {each:>8.0}"
        );
        Ok(seconds)
    };
    for side in [64, 128, 256] {
        row(&lights(4, side, side)?, 4, options)?;
    }
    for count in [1, 2, 8, 16] {
        row(&lights(count, 128, 128)?, count, options)?;
    }
    threads(library)
}

/// One thread and two by turns, and the median of the ratios.
fn threads(library: &SceneMaterialLoader) -> Outcome<()> {
    let sheet = lights(4, 512, 512)?;
    let with = |threads| -> Outcome<f64> {
        let savings = Optimizations::LOSSLESS;
        Ok(timed(1, &sheet, library, Options { savings, threads })?.1)
    };
    let mut gains = Vec::new();
    for _ in 0..7 {
        gains.push(with(1)? / with(2)?);
    }
    gains.sort_by(f64::total_cmp);
    println!(
        "two threads give {:.2} times one thread's speed ({:.2} to {:.2} in seven runs)",
        gains[3], gains[0], gains[6]
    );
    Ok(())
}

/// Brute force against all savings on every built-in scene, at its own size or about another.
fn savings(library: &SceneMaterialLoader, size: Option<(u32, u32)>) -> Outcome<()> {
    println!("\nscene               size  evaluations     time  mean steps  most steps  lossless");
    let (mut evaluations, mut times, mut count) = (0.0, 0.0, 0.0);
    for name in NAMES {
        let mut sheet = builtin(name, None)?;
        if let Some((width, height)) = size {
            sheet.resize(width, height);
        }
        let with = |savings| {
            let threads = 1;
            timed(1, &sheet, library, Options { savings, threads })
        };
        let (brute, slow) = with(Optimizations::NONE)?;
        let (saved, fast) = with(Optimizations::ALL)?;
        let (lossless, _) = with(Optimizations::LOSSLESS)?;
        let same = match lossless.pixels == brute.pixels {
            true => "same bits",
            false => "DIFFERS",
        };
        let fewer = brute.account.done.evaluations as f64 / saved.account.done.evaluations as f64;
        let faster = slow / fast;
        let (a, b) = (Bitmap::display(&brute), Bitmap::display(&saved));
        let steps = a.bytes().iter().zip(b.bytes()).map(|(a, b)| a.abs_diff(*b));
        let most = steps.clone().max().unwrap_or(0);
        let mean = steps.map(f64::from).sum::<f64>() / a.bytes().len() as f64;
        let size = format!("{}x{}", brute.width, brute.height);
        println!(
            "{name:<14} {size:>9} {fewer:>11.2}x {faster:>7.2}x {mean:>11.4} {most:>11}  {same}"
        );
        evaluations += fewer.ln();
        times += faster.ln();
        count += 1.0;
    }
    let mean = |sum: f64| (sum / count).exp();
    println!(
        "geometric mean           {:>11.2}x {:>7.2}x",
        mean(evaluations),
        mean(times)
    );
    Ok(())
}
