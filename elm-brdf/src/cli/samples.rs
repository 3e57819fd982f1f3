//! The samples of one material that a command is given: a file of any format, a CUReT material,
//! or a synthetic one.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use elm_datasets::scattered::{self, ANGLES, AngleUnit};
use elm_datasets::{
    Invalid, MaterialId, OpenOptions, STANDARD_INPUT, Samples, Sampling, open, paint, uncompressed,
};

use super::common::{DataFolder, one_of};
use super::data::Source;
use super::{Failure, say};

/// How many rows a formula or a table is looked up at unless said otherwise.
const ROWS: usize = 20_000;

/// The place of an angle among [`ANGLES`], and its value.
fn angle(text: &str) -> Result<(usize, f64), String> {
    let expected = || {
        format!(
            "expected one of {} and a number, such as theta_i=30",
            ANGLES.join(", ")
        )
    };
    let (name, number) = text.split_once('=').ok_or_else(expected)?;
    let place = ANGLES.iter().position(|angle| *angle == name.trim());
    let number: f64 = number.trim().parse().map_err(|_| expected())?;
    match place {
        Some(place) if number.is_finite() => Ok((place, number)),
        _ => Err(expected()),
    }
}

/// A wavelength, or equal steps from the first to the last.
fn wavelengths(text: &str) -> Result<Vec<f64>, String> {
    let expected =
        || "expected wavelengths in nm, such as 550, or steps, such as 400:700:20".to_owned();
    let parts: Vec<f64> = text
        .split(':')
        .map(|part| part.trim().parse().map_err(|_| expected()))
        .collect::<Result<_, _>>()?;
    match parts.as_slice() {
        [one] => Ok(vec![*one]),
        [first, last, step] if first <= last && *step > 0.0 && (last - first) / step < 1e4 => {
            // The last one too where rounding leaves it a little above.
            let steps = ((last - first) / step + 1e-6).floor() as u32;
            Ok((0..=steps).map(|k| first + f64::from(k) * step).collect())
        }
        _ => Err(expected()),
    }
}

/// What a table does not say of its directions.
#[derive(Debug, Args)]
pub(super) struct AngleReading {
    /// Angles of a CSV file are in degrees rather than radians.
    #[arg(long)]
    degrees: bool,
    /// An angle that is the same in every row of a table and so no column of it: theta_i=30, in the
    /// unit of the file. For several angles, several times.
    #[arg(long = "angle", value_name = "NAME=NUMBER", value_parser = angle)]
    angles: Vec<(usize, f64)>,
}

/// What the samples themselves do not say.
#[derive(Debug, Args)]
pub(super) struct Reading {
    #[command(flatten)]
    pub(super) folder: DataFolder,
    #[command(flatten)]
    pub(super) angles: AngleReading,
    /// Values of a CSV file are BRDF times the cosine of theta_i, or of theta_o, the scatter angle,
    /// with --cosine-weighted=theta_o.
    #[arg(long, value_name = "ANGLE", num_args = 0..=1, require_equals = true,
          default_missing_value = "theta_i",
          value_parser = PossibleValuesParser::new(["theta_i", "theta_o"]))]
    cosine_weighted: Option<String>,
    /// Values of a table are reflectance factors, BRDF times pi. Columns named BRF are taken for these
    /// without being told.
    #[arg(long)]
    reflectance_factor: bool,
    /// The channels to take, in this order: columns of a CSV file, colours or wavelengths, with
    /// commas between. All columns that can be reflectance if not given.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    channels: Vec<String>,
    /// Columns of a CSV file (or channels of another file) to leave out, with commas between.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    ignore: Vec<String>,
    /// The wavelengths of the channels in nm, in their order, where their names do not say them: a list with
    /// commas between, or first:last:step, such as 400:700:20.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = wavelengths)]
    wavelengths: Vec<Vec<f64>>,
    /// Rows to look a table (MERL, RGL) or a formula up at.
    #[arg(long, value_name = "N", default_value_t = ROWS)]
    rows: usize,
    /// What to do with negative BRDF values: set them to 0, keep them, or drop the measurement.
    /// Measurements without a number (NaN, an empty cell) are left out in any case, and so are
    /// those of a negative number that stands for none, such as -999, unless all are kept.
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
    /// Values that were missing: without a number, or a number that stands for none.
    pub(super) missing: usize,
    /// The negative numbers that stood for none.
    pub(super) fills: Vec<f64>,
    /// Measurements left out for their values.
    pub(super) left_out: usize,
}

impl Material {
    /// How many values were missing or negative, what became of them, and how many are zero now.
    pub(super) fn counts(&self, way: Invalid) -> String {
        let fills: Vec<String> = self.fills.iter().map(f64::to_string).collect();
        let standing = match fills.as_slice() {
            [] => String::new(),
            _ => format!(" (no number, or {})", fills.join(", ")),
        };
        let treated = match (self.invalid, way) {
            (0, _) => "",
            (_, Invalid::Clamp) => ", set to 0",
            (_, Invalid::Keep) => ", kept",
            (_, Invalid::Drop) => ", their measurements left out",
        };
        let values = &self.samples.values;
        let zero = match values.iter().filter(|&&value| value == 0.0).count() {
            0 => String::new(),
            count => format!("; {count} of {} values are 0", values.len()),
        };
        format!(
            "{} values missing{standing}, {} negative{treated}; {} measurements left out{zero}",
            self.missing, self.invalid, self.left_out
        )
    }
}

impl AngleReading {
    pub(super) fn unit(&self) -> AngleUnit {
        if self.degrees {
            AngleUnit::Degrees
        } else {
            AngleUnit::Radians
        }
    }

    /// The angles given for all rows.
    pub(super) fn constants(&self) -> Result<[Option<f64>; 4], Failure> {
        let mut angles = [None; 4];
        for &(place, value) in &self.angles {
            if angles[place].replace(value).is_some() {
                let name = ANGLES[place];
                return Err(Failure::Usage(format!("--angle {name} is given twice")));
            }
        }
        Ok(angles)
    }
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
                unit: self.angles.unit(),
                cosine_weighted: self.cosine_weighted.as_deref() == Some("theta_i"),
            },
            columns: scattered::Columns {
                channels: self.channels.clone(),
                ignore: self.ignore.clone(),
                scatter_cosine: self.cosine_weighted.as_deref() == Some("theta_o"),
                angles: self.angles.constants()?,
                reflectance_factor: self.reflectance_factor,
                wavelengths: self.wavelengths.concat(),
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
        let piped = name == STANDARD_INPUT;
        let shown = if piped { "standard input" } else { name };
        for note in &opened.notes {
            say(&format!("note: {shown}: {note}"));
        }
        let inner = uncompressed(path);
        let stem = inner.file_stem().unwrap_or(inner.as_os_str());
        let material = Material {
            name: if piped {
                "measurements".into()
            } else {
                stem.to_string_lossy().into_owned()
            },
            id: None,
            source: format!("{shown} ({})", opened.format),
            synthetic: false,
            samples: opened.samples,
            invalid: opened.invalid,
            missing: opened.missing,
            fills: opened.fills,
            left_out: opened.left_out,
        };
        if material.missing > 0 {
            say(&format!("note: {shown}: {}", material.counts(self.invalid)));
        }
        Ok(material)
    }

    /// The files that [`read`](Self::read) reads for `name`.
    pub(super) fn inputs(&self, name: &str) -> Vec<PathBuf> {
        if name.starts_with("curet:") {
            return Source::find(self.folder.data.as_deref())
                .map_or_else(|_| Vec::new(), |s| s.files());
        }
        if name.starts_with("synthetic:") {
            return Vec::new();
        }
        if name == STANDARD_INPUT {
            return Vec::new();
        }
        vec![name.into()]
    }

    fn curet(&self, material: &str) -> Result<Material, Failure> {
        let source = Source::find(self.folder.data.as_deref())?;
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
        let rows = samples.directions.len();
        Ok(Material {
            name: of.name.clone(),
            id: (!synthetic).then_some(id),
            source: format!("{}, material {id}", source.describe()),
            synthetic,
            samples,
            invalid: measurements.invalid,
            missing: 0,
            fills: Vec::new(),
            left_out: measurements.directions.len() - rows,
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
            missing: 0,
            fills: Vec::new(),
            left_out: 0,
        })
    }
}
