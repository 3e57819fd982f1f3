//! Where the measurements come from: `--data`, then `ELM_BRDF_DATA`, then the user's cache
//! folder, then the built-in synthetic data.

use std::env;
use std::path::{Path, PathBuf};

use elm_datasets::{Invalid, MaterialId, Measurements, curet, synthetic};
use etcetera::BaseStrategy;

use super::{Failure, overwrite};
use crate::error::Error;
use crate::published;

/// The environment variable that names a folder of CUReT files.
pub(super) const VARIABLE: &str = "ELM_BRDF_DATA";

/// The synthetic data is one data set: its noise does not follow `--seed`.
const SYNTHETIC_SEED: u64 = 1;

/// A place that measurements can be loaded from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// A folder of CUReT files.
    Curet(PathBuf),
    /// The built-in synthetic data.
    Synthetic,
}

impl Source {
    /// The first place that is given or holds data.
    ///
    /// A folder that was named must hold data; only the cache may be empty.
    pub(super) fn find(named: Option<&Path>) -> Result<Self, Failure> {
        let variable = env::var_os(VARIABLE)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from);
        if let Some(dir) = named.map(Path::to_owned).or(variable) {
            if !dir.is_dir() {
                return Err(Error::NoFolder { path: dir }.into());
            }
            return Ok(Self::Curet(inner(dir)));
        }
        Ok(cache()
            .filter(|dir| curet::is_present(dir))
            .map_or(Self::Synthetic, Self::Curet))
    }

    /// The materials that `choice` names: `paper`, `all`, or a list of numbers and names with
    /// commas between.
    pub(super) fn select(&self, choice: &str) -> Result<Vec<MaterialId>, Failure> {
        match choice.trim() {
            "paper" => Ok(published::materials()),
            "all" => Ok(MaterialId::all().collect()),
            list => list
                .split(',')
                .map(|name| match self {
                    Self::Curet(_) => name.parse(),
                    Self::Synthetic => synthetic::find(name),
                })
                .collect::<Result<_, _>>()
                .map_err(|error: elm_datasets::Error| Failure::Usage(error.to_string())),
        }
    }

    /// Reads or makes the measurements of these materials.
    pub(super) fn load(
        &self,
        materials: &[MaterialId],
        invalid: Invalid,
    ) -> Result<Measurements, Failure> {
        match self {
            Self::Curet(dir) => Ok(curet::read(dir, materials, invalid)?),
            Self::Synthetic => Ok(synthetic::measurements(SYNTHETIC_SEED, materials, invalid)),
        }
    }

    /// The files there.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        match self {
            Self::Curet(dir) => overwrite::files_in(dir),
            Self::Synthetic => Vec::new(),
        }
    }

    /// What a picture's words call this place.
    pub(super) fn caption(&self) -> &'static str {
        match self {
            Self::Curet(_) => "CUReT",
            Self::Synthetic => "synthetic data",
        }
    }

    /// What a report calls this place.
    pub(super) fn describe(&self) -> String {
        match self {
            Self::Curet(dir) => format!("CUReT files in {}", dir.display()),
            Self::Synthetic => format!("built-in synthetic data, seed {SYNTHETIC_SEED}"),
        }
    }
}

/// The folder itself, or the folder `curet` in it where only that one holds data.
fn inner(dir: PathBuf) -> PathBuf {
    let below = dir.join("curet");
    if !curet::is_present(&dir) && curet::is_present(&below) {
        below
    } else {
        dir
    }
}

/// Where downloaded CUReT files are kept.
pub(super) fn cache() -> Option<PathBuf> {
    let base = etcetera::choose_base_strategy().ok()?;
    Some(base.cache_dir().join("elm-brdf").join("curet"))
}
