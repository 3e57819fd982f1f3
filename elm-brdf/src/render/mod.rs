//! Pictures of scenes with learnt materials, and the account of the work done and skipped.
//!
//! A [`Scene`] is read from TOML; [`render`] checks it, reads its files and traces it. Materials
//! come from a [`Supply`], each on first need. Paths travel in waves: at each surface the
//! evaluations of all paths of a tile are gathered, sorted by material and carried out together,
//! so that a network sees long batches. Light is sampled both from the lights and from the
//! material, and both are combined by multiple importance sampling.
//!
//! [`Savings`] says what may be left out, and [`Account`] what was. With
//! [`Savings::LOSSLESS`] the picture is the same, bit for bit, as with [`Savings::NONE`]; the
//! rest stays within bounds that are smaller than a display step. Threads never change a picture:
//! random numbers belong to pixels, sums have a fixed order.
//!
//! A ray that leaves the scene has no material to evaluate, so pixels off the geometry cost
//! nothing with or without savings.

mod account;
mod batch;
mod builtin;
mod bvh;
mod camera;
mod distribution;
mod economy;
mod environment;
mod error;
mod film;
mod light;
mod material;
mod mesh;
mod picture;
mod proxy;
mod random;
pub mod scene;
mod shape;
mod sheet;
mod shelf;
mod supply;
mod tracer;
mod vector;
mod world;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;

pub use account::{Account, Savings, Seconds, Work};
pub use builtin::{NAMES as BUILTIN_NAMES, builtin};
pub use error::{MeshProblem, Place, SceneError};
pub use material::Material;
pub use picture::Bitmap;
pub use scene::Scene;
pub use sheet::{Content, Panel, Sheet};
pub use supply::{Analytic, Library, Recipe, Supplied, Supply, default_network};

use account::{Reason, Tally};
use batch::Batch;
use film::Film;
use shelf::Shelf;
use tracer::Tracer;
use world::World;

use crate::error::Result;

/// Side of a tile, in pixels.
const TILE: u32 = 32;
/// Samples of every pixel before the first is looked at for stopping.
const FIRST_SAMPLES: u32 = 4;

/// Samples of every pixel between looks, so that a tile's samples take a few megabytes.
const MOST_SAMPLES: u32 = 64;
/// Samples of a picture from which on it is worth fitting smaller networks.
const SAMPLES_WORTH_ECONOMY: u64 = 1 << 19;

/// How to render, beside what the scene says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Work that may be left out.
    pub savings: Savings,
    /// Worker threads; 0 for as many as the machine has.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            savings: Savings::ALL,
            threads: 0,
        }
    }
}

/// A finished picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Linear radiance in red, green and blue, row by row from the top.
    pub pixels: Vec<[f64; 3]>,
    /// Words and the middle of their line in pixels, with `{data}` filled in.
    pub labels: Vec<(String, [f64; 2])>,
    /// Words for the foot of the picture.
    pub caption: String,
    /// Factor on the radiance before display.
    pub gain: f64,
    /// What the materials that were used are called.
    pub names: Vec<String>,
    /// Where they come from, each source once.
    pub origins: Vec<String>,
    /// What was done.
    pub account: Account,
}

/// Renders a scene with materials from `supply`. `progress` is told now and then how many of the
/// samples are done, from any thread.
///
/// # Errors
/// [`crate::Error::Scene`] for a scene that cannot be, naming file and line; whatever `supply` and
/// the models report.
pub fn render(
    scene: &Scene,
    supply: &dyn Supply,
    options: Options,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Rendering> {
    render_within(scene, supply, options, 0.5, progress)
}

/// As [`render`], with bounds of `steps` display steps.
fn render_within(
    scene: &Scene,
    supply: &dyn Supply,
    options: Options,
    steps: f64,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Rendering> {
    let start = Instant::now();
    let threads = match options.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|reason| SceneError::Threads {
            threads,
            reason: reason.to_string(),
        })?;
    let world = World::new(scene)?;
    let image = &scene.image;
    let samples = u64::from(image.width) * u64::from(image.height) * u64::from(image.samples);
    // A smaller network pays for its own fitting only in a picture of some size.
    let economise = options.savings.networks && samples >= SAMPLES_WORTH_ECONOMY;
    let shelf = Shelf::new(scene, supply, economise);
    if !options.savings.materials {
        shelf.fill()?;
    }
    let mut picture = Picture::new(scene, &world, &shelf, options.savings, steps);
    pool.install(|| picture.take_all(progress))?;
    let mut rendering = picture.finish();
    let account = &mut rendering.account;
    account.seconds.total = start.elapsed().as_secs_f64();
    account.threads = threads;
    Ok(rendering)
}

/// A picture in the making.
struct Picture<'a> {
    scene: &'a Scene,
    tracer: Tracer<'a>,
    film: Mutex<Film>,
    tally: Mutex<Tally>,
    gain: f64,
}

impl<'a> Picture<'a> {
    fn new(
        scene: &'a Scene,
        world: &'a World,
        shelf: &'a Shelf<'a>,
        savings: Savings,
        steps: f64,
    ) -> Self {
        let image = &scene.image;
        let gain = image.exposure.exp2();
        Self {
            scene,
            tracer: Tracer {
                world,
                shelf,
                savings,
                width: image.width,
                depth: image.depth,
                seed: image.seed,
                samples_per_pixel: image.samples,
                // Steps of 8-bit sRGB where its slope is steepest, 12.92 at black.
                tolerance: steps / (255.0 * 12.92 * gain),
                gain,
                steps,
            },
            film: Mutex::new(Film::new(image.width, image.height)),
            tally: Mutex::new(Tally::new(world.materials.len())),
            gain,
        }
    }

    /// All samples, in rounds that double, after each of which some pixels stop.
    fn take_all(&mut self, progress: &(dyn Fn(u64, u64) + Sync)) -> Result<()> {
        let image = &self.scene.image;
        let pixels = image.width as usize * image.height as usize;
        let total = image.samples;
        let all = pixels as u64 * u64::from(total);
        let done = AtomicU64::new(0);
        let mut wanted = vec![true; pixels];
        let mut taken = 0;
        while taken < total && wanted.contains(&true) {
            let until = match taken {
                _ if !self.tracer.savings.samples => taken + MOST_SAMPLES,
                0 => FIRST_SAMPLES,
                _ => taken + taken.min(MOST_SAMPLES),
            };
            let until = until.min(total);
            tiles(image.width, image.height)
                .into_par_iter()
                .try_for_each(|tile| {
                    let work: Vec<_> = tile
                        .pixels(image.width)
                        .filter(|&pixel| wanted[pixel as usize])
                        .map(|pixel| (pixel, taken..until))
                        .collect();
                    self.take(&work)?;
                    let samples = work.len() as u64 * u64::from(until - taken);
                    progress(done.fetch_add(samples, Ordering::Relaxed) + samples, all);
                    Ok::<(), crate::Error>(())
                })?;
            taken = until;
            if self.tracer.savings.samples && taken < total {
                let film = self.film.get_mut().unwrap_or_else(PoisonError::into_inner);
                let before = wanted.iter().filter(|w| **w).count();
                wanted = film.unfinished(total, self.gain, self.tracer.steps);
                // A pixel that stopped stays stopped: its samples would no longer be the first.
                for (pixel, wanted) in wanted.iter_mut().enumerate() {
                    *wanted &= film.samples(pixel) == taken;
                }
                let stopped = before - wanted.iter().filter(|w| **w).count();
                let left_out = stopped as u64 * u64::from(total - taken);
                self.stop(left_out);
                progress(done.fetch_add(left_out, Ordering::Relaxed) + left_out, all);
            }
        }
        Ok(())
    }

    /// Accounts for samples left out, at the mean rate of evaluations so far.
    fn stop(&mut self, left_out: u64) {
        let tally = self.tally.get_mut().unwrap_or_else(PoisonError::into_inner);
        let samples = tally.samples.max(1);
        for material in 0..tally.evaluations.len() {
            let evaluations = tally.evaluations[material] as u128;
            let saved = evaluations * u128::from(left_out) / u128::from(samples);
            tally.skip(Reason::Converged, material, saved as u64);
        }
        tally.samples_skipped += left_out;
    }

    /// Takes the samples of a tile.
    fn take(&self, work: &[(u32, std::ops::Range<u32>)]) -> Result<()> {
        let start = Instant::now();
        let mut tally = Tally::new(self.tracer.world.materials.len());
        let mut batch = Batch::default();
        let mut samples = Vec::new();
        self.tracer
            .samples(work, &mut batch, &mut tally, |sample| samples.push(sample))?;
        tally.tile_seconds = start.elapsed().as_secs_f64();
        // Tiles share no pixel, so it does not matter which comes first.
        let mut film = self.film.lock().unwrap_or_else(PoisonError::into_inner);
        samples.iter().for_each(|sample| film.add(sample));
        self.tally
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .merge(&tally);
        Ok(())
    }

    fn finish(self) -> Rendering {
        let image = &self.scene.image;
        let labels = self.labels();
        let film = self
            .film
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let tally = self
            .tally
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let shelf = self.tracer.shelf;
        let cost = |m: &Material| [m.multiply_adds(), m.small_multiply_adds()];
        let materials: Vec<(&str, Option<[usize; 2]>)> = shelf
            .stocked()
            .map(|(name, stocked)| (name, stocked.map(|s| cost(&s.material))))
            .collect();
        let mut account = tally.account(&materials);
        account.savings = Some(self.tracer.savings);
        for (name, stocked) in shelf.stocked() {
            let Some(stocked) = stocked else { continue };
            account.seconds.materials += stocked.seconds;
            let albedo = stocked.material.largest_albedo();
            if albedo > 1.0 {
                account.notes.push(format!(
                    "material '{name}' reflects up to {albedo:.2} times the light it receives"
                ));
            }
        }
        let origins = shelf.origins();
        let titles = shelf
            .stocked()
            .filter_map(|(_, stocked)| stocked?.title.clone());
        let names: Vec<String> = titles.collect();
        Rendering {
            width: image.width,
            height: image.height,
            pixels: film.picture(),
            labels,
            caption: image
                .caption
                .replace("{data}", &origins.join("; "))
                .replace("{name}", &names.join(", ")),
            names,
            origins,
            gain: self.gain,
            account,
        }
    }

    /// The labels of spheres, a little below each.
    fn labels(&self) -> Vec<(String, [f64; 2])> {
        let camera = &self.tracer.world.camera;
        self.scene
            .sphere
            .iter()
            .filter_map(|entry| {
                let sphere = entry.get_ref();
                let below = vector::Vec3::from(sphere.centre) - camera.up() * sphere.radius * 1.12;
                let label = sphere.label.as_deref()?;
                let title = self.tracer.shelf.title(sphere.material.get_ref());
                Some((label.replace("{name}", title), camera.project(below)?))
            })
            .collect()
    }
}

/// A square of pixels, or less at the edges.
struct Tile {
    columns: std::ops::Range<u32>,
    rows: std::ops::Range<u32>,
}

impl Tile {
    /// Indices of its pixels in a picture of this width.
    fn pixels(self, width: u32) -> impl Iterator<Item = u32> {
        let Self { columns, rows } = self;
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

fn tiles(width: u32, height: u32) -> Vec<Tile> {
    let ranges = |length: u32| {
        (0..length)
            .step_by(TILE as usize)
            .map(move |s| s..(s + TILE).min(length))
    };
    ranges(height)
        .flat_map(|rows| {
            ranges(width).map(move |columns| Tile {
                columns,
                rows: rows.clone(),
            })
        })
        .collect()
}
