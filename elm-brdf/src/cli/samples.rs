//! The samples of one material that a command is given: a file of any format, a CUReT material,
//! or a synthetic one.

use std::path::{Path, PathBuf};

use clap::Args;
use elm_datasets::scattered::{self, AngleUnit};
use elm_datasets::{Invalid, MaterialId, OpenOptions, Samples, Sampling, open, paint};

use super::Failure;
use super::common::one_of;
use super::data::Source;

/// How many rows a formula or a table is looked up at unless said otherwise.
const ROWS: usize = 20_000;

/// What the samples themselves do not say.
#[derive(Debug, Args)]
pub(super) struct Reading {
    /// Folder of CUReT files: table.txt with abrdf.dat, or with rbrdf.dat, gbrdf.dat and
    /// bbrdf.dat.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Angles of a CSV file are in degrees rather than radians.
    #[arg(long)]
    degrees: bool,
    /// Values of a CSV file are BRDF times the cosine of theta_i.
    #[arg(long)]
    cosine_weighted: bool,
    /// Rows to look a table (MERL, RGL) or a formula up at.
    #[arg(long, value_name = "N", default_value_t = ROWS)]
    rows: usize,
    /// What to do with negative BRDF values: set them to 0, keep them, or drop the measurement.
    #[arg(long, value_name = "WAY", default_value = "clamp",
          value_parser = one_of::<Invalid>(Invalid::ALL.map(Invalid::name)))]
    pub(super) invalid: Invalid,
}

/// The samples of one material.
#[derive(Debug)]
pub(super) struct Material {
    /// Its name.
    pub(super) name: String,
    /// Its number in CUReT, where the samples are CUReT's measurements.
    pub(super) id: Option<MaterialId>,
    /// Where the samples come from, for a report.
    pub(super) source: String,
    /// Whether they come from formulas.
    pub(super) synthetic: bool,
    /// The samples.
    pub(super) samples: Samples,
    /// Negative values met.
    pub(super) invalid: usize,
}

impl Reading {
    /// Reads `name`: a file, `curet:` and a number or name, or `synthetic:paint`.
    pub(super) fn read(&self, name: &str) -> Result<Material, Failure> {
        if let Some(material) = name.strip_prefix("curet:") {
            return self.curet(material);
        }
        if let Some(formula) = name.strip_prefix("synthetic:") {
            return self.formula(formula);
        }
        let options = OpenOptions {
            scattered: scattered::Options {
                unit: if self.degrees {
                    AngleUnit::Degrees
                } else {
                    AngleUnit::Radians
                },
                cosine_weighted: self.cosine_weighted,
            },
            sampling: Sampling::Random {
                rows: self.rows,
                seed: 1,
            },
            invalid: self.invalid,
            ..OpenOptions::default()
        };
        let path = Path::new(name);
        let opened = open(path, &options)?;
        let stem = path.file_stem().unwrap_or(path.as_os_str());
        Ok(Material {
            name: stem.to_string_lossy().into_owned(),
            id: None,
            source: format!("{} ({})", path.display(), opened.format),
            synthetic: false,
            samples: opened.samples,
            invalid: opened.invalid,
        })
    }

    fn curet(&self, material: &str) -> Result<Material, Failure> {
        let source = Source::find(self.data.as_deref())?;
        let ids = source.select(material)?;
        let &[id] = ids.as_slice() else {
            return Err(Failure::Usage(format!(
                "curet:{material} names {} materials, expected one",
                ids.len()
            )));
        };
        let measurements = source.load(&ids, self.invalid)?;
        let (Some(samples), Some(of)) = (measurements.samples(0), measurements.materials.first())
        else {
            return Err(Failure::Usage(format!(
                "curet:{material}: no such material"
            )));
        };
        let synthetic = source == Source::Synthetic;
        Ok(Material {
            name: of.name.clone(),
            id: (!synthetic).then_some(id),
            source: format!("{}, material {id}", source.describe()),
            synthetic,
            samples,
            invalid: measurements.invalid,
        })
    }

    fn formula(&self, name: &str) -> Result<Material, Failure> {
        if name != "paint" {
            return Err(Failure::Usage(format!(
                "unknown formula 'synthetic:{name}' (expected synthetic:paint)"
            )));
        }
        Ok(Material {
            name: "metallic paint".to_owned(),
            id: None,
            source: "synthetic metallic paint, seed 1".to_owned(),
            synthetic: true,
            samples: paint::samples(self.rows, 1)?,
            invalid: 0,
        })
    }
}
