//! The interface that a scene gets its materials' reflectance through.

use std::error::Error;
use std::path::Path;

use elm_datasets::Brdf;

use crate::vector::Rgb;

/// A reflectance, and how it is to be used.
pub struct LoadedMaterial {
    /// The model or table.
    pub brdf: Box<dyn Brdf>,
    /// Multiplications and additions that one evaluation costs in matrix products; 0 for a formula.
    pub multiply_adds: usize,
    /// Factors on red, green and blue, from 0 to 1e6.
    pub tint: Rgb,
    /// Whether it is scaled down where it would reflect more light than it receives.
    pub conserve_energy: bool,
    /// Where it comes from, in a word or two: a data set, a file's name, "a formula".
    pub origin: String,
    /// What its source calls the material, if it does.
    pub name: Option<String>,
    /// What was assumed of its source.
    pub notes: Vec<String>,
}

impl LoadedMaterial {
    /// Without a tint, and as it is.
    #[must_use]
    pub fn new(brdf: Box<dyn Brdf>, origin: impl Into<String>) -> Self {
        Self {
            brdf,
            multiply_adds: 0,
            tint: [1.0; 3],
            conserve_energy: false,
            origin: origin.into(),
            name: None,
            notes: Vec::new(),
        }
    }
}

/// Why a material could not be loaded: an error of whoever loads it.
pub type LoadError = Box<dyn Error + Send + Sync>;

/// Something that makes materials of their tables `M` in a scene file.
pub trait MaterialLoader<M>: Sync {
    /// The material that a table asks for; files that it names are relative to `dir`.
    ///
    /// # Errors
    /// Where there is none.
    fn load(&self, table: &M, dir: &Path) -> Result<LoadedMaterial, LoadError>;
}
