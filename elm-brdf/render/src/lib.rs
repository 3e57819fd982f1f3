//! Pictures of scenes with learnt materials, and the account of the work done and skipped.
//!
//! A [`Scene`] is read from TOML; [`render`] checks it, reads its files and traces it. Materials
//! come from a [`MaterialLoader`], each on first need. Paths travel in waves: at each surface the
//! evaluations of all paths of a tile are gathered, sorted by material and carried out together,
//! so that a network sees long batches. Light is sampled both from the lights and from the
//! material, and both are combined by multiple importance sampling.
//!
//! [`Optimizations`] says what may be left out, and [`RenderStats`] what was. With
//! [`Optimizations::LOSSLESS`] the picture is the same, bit for bit, as with [`Optimizations::NONE`]; the
//! rest stays within bounds that are smaller than a display step. Threads never change a picture:
//! random numbers belong to pixels, sums have a fixed order.
//!
//! A ray that leaves the scene has no material to evaluate, so pixels off the geometry cost
//! nothing with or without savings.

#![forbid(unsafe_code)]

mod adaptive;
mod bvh;
mod camera;
mod compiled_scene;
mod distribution;
mod environment;
mod error;
mod film;
mod light;
mod loader;
mod material;
mod material_cache;
mod mesh;
mod picture;
mod random;
pub mod scene;
mod shading_queue;
mod shape;
mod sheet;
mod stats;
pub mod testing;
mod tracer;
mod vector;
mod vertex;

pub use error::{Error, MeshProblem, Place, Result};
pub use loader::{LoadError, LoadedMaterial, MaterialLoader};
pub use material::Material;
pub use picture::Bitmap;
pub use scene::Scene;
pub use sheet::{Content, Panel, Sheet};
pub use stats::{EvalCost, Optimizations, RenderStats, Seconds};

/// How to render, beside what the scene says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Work that may be left out.
    pub savings: Optimizations,
    /// Worker threads; 0 for as many as the machine has.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            savings: Optimizations::ALL,
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
    pub account: RenderStats,
}

/// Renders a scene with materials from `loader`. `progress` is told now and then how many of the
/// samples are done, from any thread.
///
/// # Errors
/// [`Error`] for a scene that cannot be, naming file and line; whatever `loader` and
/// the models report.
pub fn render<M: Sync>(
    scene: &Scene<M>,
    loader: &dyn MaterialLoader<M>,
    options: Options,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Rendering> {
    let mut rendered = adaptive::render(&[scene], &[], loader, options, progress)?;
    // One for each scene.
    rendered.pop().ok_or(Error::Sheet { panel: 0 })
}

// The README's code is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
