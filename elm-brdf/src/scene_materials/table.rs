//! A material as a scene's file describes it, and what it names.

use std::path::{Path, PathBuf};

use elm_datasets::color::{Colored, SpectralColor};
use elm_datasets::lobes::Formula;
use elm_datasets::merl::Merl;
use elm_datasets::rgl::Rgl;
use elm_datasets::{Brdf, Format};
use serde::Deserialize;

use crate::error::{Error, Result};

/// A material as a scene file describes it. Exactly one of `curet`, `csv`, `model`, `table` and `analytic`
/// says where it comes from.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialTable {
    /// A material of CUReT, by number or name; of the synthetic data if CUReT's files are not at hand.
    pub curet: Option<String>,
    /// Measurements in a CSV file, or in another that `fit` reads.
    pub csv: Option<PathBuf>,
    /// Whether the angles of a CSV file are in degrees.
    #[serde(default)]
    pub degrees: bool,
    /// Whose cosine the values of a CSV file are BRDF times of: `theta_i` or `theta_o`.
    pub cosine_weighted: Option<String>,
    /// Channels to take of a file of measurements, in this order.
    #[serde(default)]
    pub channels: Vec<String>,
    /// Columns to leave out of one.
    #[serde(default)]
    pub ignore: Vec<String>,
    /// Wavelengths in nm of one's channels, where their names do not say them.
    #[serde(default)]
    pub wavelengths: Vec<f64>,
    /// What to do with negative values in one: `clamp` (if not given), `keep` or `drop`.
    pub invalid: Option<String>,
    /// What is fitted to measurements: `elm` (if not given), `interpolation`, which passes through
    /// them, or one of the names of [`baselines::Analytic`](crate::baselines::Analytic).
    pub fit: Option<String>,
    /// Neurons of a network that is fitted.
    pub neurons: Option<usize>,
    /// A saved model.
    pub model: Option<PathBuf>,
    /// A measured table, shown as it is: MERL `.binary` or RGL `.bsdf`.
    pub table: Option<PathBuf>,
    /// A formula: `lambert`, `oren-nayar`, `ward` or `ggx`.
    pub analytic: Option<String>,
    /// Reflectance of the formula's diffuse part.
    pub albedo: Option<f64>,
    /// Roughness of the formula: sigma of Oren-Nayar in radians, alpha of Ward and GGX.
    pub roughness: Option<f64>,
    /// Strength of the formula's highlight: Ward's albedo, reflectance of GGX at normal incidence.
    pub specular: Option<f64>,
    /// Colour that the values are multiplied by, for data without colour.
    pub tint: Option<[f64; 3]>,
    /// Degrees that a material which is not isotropic is turned about the normal, from the surface's tangent
    /// towards its bitangent. The tangent goes around the vertical axis; of a rectangle it is the edge u.
    #[serde(default)]
    pub rotation: f64,
    /// Scale the material down where it would reflect more light than it receives.
    #[serde(default)]
    pub conserve_energy: bool,
}

impl MaterialTable {
    /// The material in a file of one's own: a saved model, measurements, to which a network is fitted, or a
    /// measured table (MERL, RGL), shown as it is.
    ///
    /// # Errors
    /// Those of [`Format::of`] but [`UnknownFormat`](elm_datasets::Error::UnknownFormat), for such a file is
    /// a model's.
    pub fn of_file(path: &Path) -> Result<Self> {
        let file = Some(path.to_owned());
        let none = Self::default();
        Ok(match Format::of(path) {
            Ok(Format::Merl | Format::Rgl) => Self {
                table: file,
                ..none
            },
            Ok(_) => Self { csv: file, ..none },
            Err(elm_datasets::Error::UnknownFormat { .. }) => Self {
                model: file,
                ..none
            },
            Err(error) => return Err(error.into()),
        })
    }

    /// The lines of a scene that say where the material comes from.
    pub(crate) fn to_toml(&self) -> String {
        let quoted = |text: &str| toml::Value::from(text).to_string();
        let path = |path: &PathBuf| quoted(&path.to_string_lossy());
        let sources = [
            ("curet", self.curet.as_deref().map(quoted)),
            ("csv", self.csv.as_ref().map(path)),
            ("model", self.model.as_ref().map(path)),
            ("table", self.table.as_ref().map(path)),
        ];
        let lines = sources
            .into_iter()
            .filter_map(|(name, value)| Some(format!("{name} = {}", value?)));
        lines.collect::<Vec<_>>().join("\n")
    }
}

/// The table of a file, as it is, and the names of its channels; of a spectrum the
/// [colors](elm_datasets::color) if these are asked for.
///
/// # Errors
/// Those of [`Format::of`] and of the readers; [`Error::UnknownName`] for a file that is no table.
pub fn measured_table(path: &Path, in_color: bool) -> Result<(Box<dyn Brdf>, Vec<String>)> {
    let rgb = || ["red", "green", "blue"].map(str::to_owned).to_vec();
    Ok(match Format::of(path)? {
        Format::Merl => (Box::new(Merl::read(path)?), rgb()),
        Format::Rgl => {
            let table = Rgl::read(path)?;
            let names = table.channels().names();
            let color = SpectralColor::of(&names).map_err(elm_datasets::Error::from)?;
            match color.filter(|_| in_color) {
                None => (Box::new(table), names),
                Some(color) => (Box::new(Colored::new(table, color)), rgb()),
            }
        }
        other => {
            return Err(Error::UnknownName {
                what: "table",
                name: other.name().to_owned(),
                expected: "merl, rgl".to_owned(),
            });
        }
    })
}

/// Where a material comes from.
pub(super) enum Source<'a> {
    Curet(&'a str),
    Samples(&'a Path),
    Model(&'a Path),
    Table(&'a Path),
    Formula(&'a str),
}

impl MaterialTable {
    pub(super) fn source(&self) -> Result<Source<'_>> {
        let sources = [
            self.curet.as_deref().map(Source::Curet),
            self.csv.as_deref().map(Source::Samples),
            self.model.as_deref().map(Source::Model),
            self.table.as_deref().map(Source::Table),
            self.analytic.as_deref().map(Source::Formula),
        ];
        let mut named = sources.into_iter().flatten();
        match (named.next(), named.next()) {
            (Some(source), None) => Ok(source),
            _ => Err(Error::MaterialSource),
        }
    }

    /// The files that it names, relative to the scene's folder.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let files = [&self.csv, &self.model, &self.table];
        files.into_iter().filter_map(|file| file.as_deref())
    }

    pub(super) fn formula(&self, name: &str) -> Result<Formula> {
        let albedo = self.albedo.unwrap_or(0.5);
        let roughness = self.roughness.unwrap_or(0.3);
        let specular = self.specular.unwrap_or(0.04);
        Ok(match name {
            "lambert" => Formula::lambert(albedo)?,
            "oren-nayar" => Formula::oren_nayar(albedo, roughness)?,
            "ward" => Formula::lambert(albedo)?.with_ward(specular, roughness)?,
            "ggx" => Formula::lambert(albedo)?.with_ggx(specular, roughness)?,
            _ => {
                return Err(Error::UnknownName {
                    what: "formula",
                    name: name.to_owned(),
                    expected: "lambert, oren-nayar, ward, ggx".to_owned(),
                });
            }
        })
    }
}
