//! Pictures in the making: rounds of samples over tiles, after each of which some pixels stop.
//! Pictures whose difference is shown are made together, sample by sample at the same places, and
//! a pixel stops in all of them at once.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use toml::Spanned;

use crate::compiled_scene::CompiledScene;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::loader::MaterialLoader;
use crate::material_cache::MaterialCache;
use crate::scene::{Image, Scene, Sphere};
use crate::shading_queue::ShadingQueue;
use crate::stats::{Optimizations, Reason, TileStats};
use crate::tracer::{Sample, Tracer};
use crate::vector::Vec3;
use crate::{Options, Rendering};

/// What any bounded saving may cost, in display steps.
const STEPS: f64 = 0.5;
/// Side of a tile, in pixels.
const TILE: u32 = 32;
/// Samples of every pixel before the first is looked at for stopping: the fewest from which the
/// error can be told.
const FIRST_SAMPLES: u32 = 4;
/// Samples of every pixel between looks, so that a tile's samples take a few megabytes.
const MAX_SAMPLES: u32 = 64;

/// A difference of two pictures that will be shown, enlarged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Difference {
    /// Index of one picture.
    pub(crate) of: usize,
    /// Index of the other.
    pub(crate) from: usize,
    pub(crate) factor: f64,
}

/// Renders scenes of one size, of which some differences will be shown, too.
pub(crate) fn render<M: Sync>(
    scenes: &[&Scene<M>],
    differences: &[Difference],
    loader: &dyn MaterialLoader<M>,
    options: Options,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Vec<Rendering>> {
    let start = Instant::now();
    let threads = match options.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|reason| Error::Threads {
            threads,
            reason: reason.to_string(),
        })?;
    let mut savings = options.savings;
    // Samples are compared one by one.
    let alike = |a: &Image, b: &Image| (a.samples, a.seed) == (b.samples, b.seed);
    savings.samples &= differences.is_empty()
        || scenes
            .windows(2)
            .all(|pair| alike(&pair[0].image, &pair[1].image));
    let worlds = scenes
        .iter()
        .map(|scene| CompiledScene::new(scene))
        .collect::<Result<Vec<_>, _>>()?;
    let caches: Vec<MaterialCache<'_>> = scenes
        .iter()
        .map(|scene| MaterialCache::new(scene, loader))
        .collect();
    if !savings.materials {
        caches.iter().try_for_each(MaterialCache::load_all)?;
    }
    // Both pictures of a difference may be off.
    let enlarged = differences
        .iter()
        .fold(1.0, |most: f64, d| most.max(2.0 * d.factor.abs()));
    let pictures = scenes
        .iter()
        .zip(worlds.iter().zip(&caches))
        .map(|(scene, (world, cache))| Picture::new(scene, world, cache, savings, enlarged))
        .collect();
    let mut pictures_in_step = LockstepRender::new(pictures, differences, savings)?;
    pool.install(|| pictures_in_step.render_passes(progress))?;
    let mut renderings: Vec<Rendering> = pictures_in_step
        .pictures
        .into_iter()
        .map(Picture::finish)
        .collect();
    let seconds = start.elapsed().as_secs_f64() / renderings.len() as f64;
    for Rendering { account, .. } in &mut renderings {
        account.seconds.total = seconds;
        account.threads = threads;
    }
    Ok(renderings)
}

/// Pictures that are made together.
struct LockstepRender<'a> {
    width: u32,
    height: u32,
    samples: u32,
    /// Whether pixels may stop.
    adaptive: bool,
    pictures: Vec<Picture<'a>>,
    differences: Vec<(Difference, Mutex<Film>)>,
}

impl<'a> LockstepRender<'a> {
    fn new(
        pictures: Vec<Picture<'a>>,
        differences: &[Difference],
        savings: Optimizations,
    ) -> Result<Self> {
        let size = |picture: &Picture<'_>| {
            let image = picture.image;
            (image.width, image.height)
        };
        let Some(first) = pictures.first() else {
            return Err(Error::Sheet { panel: 0 });
        };
        let (width, height) = size(first);
        if let Some(panel) = pictures.iter().position(|p| size(p) != (width, height)) {
            return Err(Error::Sheet { panel });
        }
        Ok(Self {
            width,
            height,
            samples: first.image.samples,
            adaptive: savings.samples,
            // Only for stopping.
            differences: differences
                .iter()
                .filter(|_| savings.samples)
                .map(|difference| (*difference, Mutex::new(Film::new(width, height))))
                .collect(),
            pictures,
        })
    }

    /// All samples, in rounds that double, after each of which some pixels stop.
    fn render_passes(&mut self, progress: &(dyn Fn(u64, u64) + Sync)) -> Result<()> {
        let pixels = self.width as usize * self.height as usize;
        let each = self.pictures.len() as u64;
        let all = pixels as u64 * u64::from(self.samples) * each;
        let done = AtomicU64::new(0);
        let report = |samples: u64| {
            progress(done.fetch_add(samples, Ordering::Relaxed) + samples, all);
        };
        let mut wanted = vec![true; pixels];
        let mut taken = 0;
        while taken < self.samples && wanted.contains(&true) {
            let until = match taken {
                _ if !self.adaptive => taken + MAX_SAMPLES,
                0 => FIRST_SAMPLES,
                _ => taken + taken.min(MAX_SAMPLES),
            };
            let until = until.min(self.samples);
            tiles(self.width, self.height)
                .into_par_iter()
                .try_for_each(|tile| {
                    let work: Vec<_> = tile
                        .pixels(self.width)
                        .filter(|&pixel| wanted[pixel as usize])
                        .map(|pixel| (pixel, taken..until))
                        .collect();
                    self.take(&work)?;
                    report(work.len() as u64 * u64::from(until - taken) * each);
                    Ok::<(), crate::Error>(())
                })?;
            taken = until;
            if self.adaptive && taken < self.samples {
                let before = wanted.iter().filter(|w| **w).count();
                self.retire_converged(&mut wanted, taken);
                let stopped = before - wanted.iter().filter(|w| **w).count();
                let left_out = stopped as u64 * u64::from(self.samples - taken);
                for picture in &mut self.pictures {
                    picture.skip_remaining(left_out);
                }
                report(left_out * each);
            }
        }
        Ok(())
    }

    /// Keeps only the `wanted` pixels, with `taken` samples each, that have not converged in some
    /// picture or difference.
    fn retire_converged(&mut self, wanted: &mut [bool], taken: u32) {
        // Sheets are shown at the exposure of their first picture.
        let gain = self.pictures.first().map_or(1.0, |p| p.tracer.gain);
        let films = self
            .pictures
            .iter_mut()
            .map(|picture| &mut picture.film)
            .chain(self.differences.iter_mut().map(|(_, film)| film));
        let mut needed = vec![false; wanted.len()];
        for film in films {
            let film = film.get_mut().unwrap_or_else(PoisonError::into_inner);
            // A pixel that stopped stays stopped: its samples would no longer be the first.
            let unfinished = film.unfinished(self.samples, gain, STEPS);
            for (pixel, (needed, unfinished)) in needed.iter_mut().zip(unfinished).enumerate() {
                *needed |= unfinished && film.samples(pixel) == taken;
            }
        }
        for (wanted, needed) in wanted.iter_mut().zip(needed) {
            *wanted &= needed;
        }
    }

    /// Takes the samples of a tile.
    fn take(&self, work: &[(u32, Range<u32>)]) -> Result<()> {
        let samples = self
            .pictures
            .iter()
            .map(|picture| picture.take(work))
            .collect::<Result<Vec<_>>>()?;
        for (Difference { of, from, factor }, film) in &self.differences {
            let (Some(a), Some(b)) = (samples.get(*of), samples.get(*from)) else {
                continue;
            };
            let mut film = film.lock().unwrap_or_else(PoisonError::into_inner);
            for (a, b) in a.iter().zip(b) {
                let radiance = [0, 1, 2].map(|c| factor * (a.radiance[c] - b.radiance[c]));
                film.add(&Sample { radiance, ..*a });
            }
        }
        Ok(())
    }
}

/// A picture in the making.
struct Picture<'a> {
    image: &'a Image,
    spheres: &'a [Spanned<Sphere>],
    tracer: Tracer<'a>,
    film: Mutex<Film>,
    tally: Mutex<TileStats>,
}

impl<'a> Picture<'a> {
    /// `enlarged` is the factor on its errors of what is shown of it.
    fn new<M>(
        scene: &'a Scene<M>,
        world: &'a CompiledScene,
        cache: &'a MaterialCache<'a>,
        savings: Optimizations,
        enlarged: f64,
    ) -> Self {
        let image = &scene.image;
        let gain = image.exposure.exp2();
        Self {
            image,
            spheres: &scene.sphere,
            tracer: Tracer {
                world,
                cache,
                savings,
                width: image.width,
                depth: image.depth,
                seed: image.seed,
                samples_per_pixel: image.samples,
                // Steps of 8-bit sRGB where its slope is steepest, 12.92 at black.
                tolerance: STEPS / (255.0 * 12.92 * gain * enlarged),
                gain,
            },
            film: Mutex::new(Film::new(image.width, image.height)),
            tally: Mutex::new(TileStats::new(world.materials.len())),
        }
    }

    /// Accounts for samples left out, at the mean rate of evaluations so far.
    fn skip_remaining(&mut self, left_out: u64) {
        let tally = self.tally.get_mut().unwrap_or_else(PoisonError::into_inner);
        let samples = tally.samples.max(1);
        for material in 0..tally.evaluations.len() {
            let evaluations = tally.evaluations[material] as u128;
            let saved = evaluations * u128::from(left_out) / u128::from(samples);
            tally.skip(Reason::Converged, material, saved as u64);
        }
        tally.samples_skipped += left_out;
    }

    /// Takes and returns the samples of a tile.
    fn take(&self, work: &[(u32, Range<u32>)]) -> Result<Vec<Sample>> {
        let start = Instant::now();
        let mut tally = TileStats::new(self.tracer.world.materials.len());
        let mut batch = ShadingQueue::default();
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
        Ok(samples)
    }

    fn finish(self) -> Rendering {
        let image = self.image;
        let labels = self.labels();
        let film = self
            .film
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let tally = self
            .tally
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let cache = self.tracer.cache;
        let materials: Vec<(&str, Option<usize>)> = cache
            .cached()
            .map(|(name, cached)| (name, cached.map(|s| s.multiply_adds)))
            .collect();
        let mut account = tally.account(&materials);
        account.savings = Some(self.tracer.savings);
        for (name, cached) in cache.cached() {
            let Some(cached) = cached else { continue };
            account.seconds.materials += cached.seconds;
            let noted = cached.notes.iter();
            account
                .notes
                .extend(noted.map(|note| format!("material '{name}': {note}")));
            let albedo = cached.material.largest_albedo();
            if albedo > 1.0 {
                let rescaled = match cached.material.is_rescaled() {
                    true => ", rescaled to 1",
                    false => "",
                };
                account.notes.push(format!(
                    "material '{name}' reflects up to {albedo:.2} times the light it receives\
                     {rescaled}"
                ));
            }
        }
        let origins = cache.origins();
        let titles = cache
            .cached()
            .filter_map(|(_, cached)| cached?.title.clone());
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
            gain: self.tracer.gain,
            account,
        }
    }

    /// The labels of spheres, a little below each.
    fn labels(&self) -> Vec<(String, [f64; 2])> {
        let camera = &self.tracer.world.camera;
        self.spheres
            .iter()
            .filter_map(|entry| {
                let sphere = entry.get_ref();
                let below = Vec3::from(sphere.center) - camera.up() * sphere.radius * 1.12;
                let label = sphere.label.as_deref()?;
                let title = self.tracer.cache.title(sphere.material.get_ref());
                Some((label.replace("{name}", title), camera.project(below)?))
            })
            .collect()
    }
}

/// A square of pixels, or less at the edges.
struct Tile {
    columns: Range<u32>,
    rows: Range<u32>,
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
