//! Where the models of a scene's materials come from.

use std::path::{Path, PathBuf};

use elm::solve::Ridge;
use elm::{Activation, ElmParams};
use elm_datasets::scattered::{self, AngleUnit};
use elm_datasets::{
    Directions, Invalid, Measurements, OpenOptions, Samples, analytic, curet, synthetic,
};
use ndarray::{Array2, ArrayView2, Axis};

use super::scene;
use crate::brdf::{Brdf, Fit};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::link::Link;
use crate::model::{BrdfModel, BrdfParams};
use crate::reference;
use elm_datasets::geometry::{Pair, pairs};

/// A model and where it comes from, in a word: "CUReT", "stand-in", a file's name, "analytic".
pub struct Supplied {
    /// The model.
    pub brdf: Box<dyn Brdf>,
    /// The data.
    pub origin: String,
    /// What the data call the material, if they do.
    pub name: Option<String>,
    /// What was assumed of the data.
    pub notes: Vec<String>,
}

/// Something that makes the models of materials.
pub trait Supply: Sync {
    /// The model that a scene's entry asks for; its files are relative to `dir`.
    ///
    /// # Errors
    /// Where there is none.
    fn supply(&self, material: &scene::Material, dir: &Path) -> Result<Supplied>;
}

/// Models fitted to CUReT's files, to the stand-in or to files of one's own, and formulas.
pub struct Library {
    /// Folder of CUReT's files; `None` for the stand-in.
    pub curet: Option<PathBuf>,
    /// What fits a network, `fit = "elm"`, to measurements, given how many there are and how many
    /// neurons the scene asks for.
    pub network: Box<Recipe>,
}

/// Chooses a network by the number of measurements and the neurons asked for.
pub type Recipe = dyn Fn(usize, Option<usize>) -> Box<dyn Fit> + Send + Sync;

/// A [`Recipe`]: logarithmic target, ridge by leave-one-out. For a few hundred measurements, 100
/// sine neurons on reciprocal inputs; for many, 256 tanh neurons on inputs that spread out
/// highlights or, for measurements that are not reciprocal, on those that tell light from viewer,
/// whichever errs less on a tenth of the measurements held out.
#[must_use]
pub fn default_network(measurements: usize, neurons: Option<usize>) -> Box<dyn Fit> {
    let network = |features, usual, activation| BrdfParams {
        features,
        link: Link::default_log(),
        network: ElmParams::new(neurons.unwrap_or(usual))
            .activation(activation)
            .solver(Ridge::leave_one_out())
            .seed(1),
    };
    match measurements {
        0..1000 => Box::new(network(Features::ReciprocalCosines, 100, Activation::Sine)),
        _ => Box::new(BestOf([
            network(Features::Highlight, 256, Activation::Tanh),
            network(Features::Cosines, 256, Activation::Tanh),
        ])),
    }
}

/// The one of two networks that errs less on measurements held out.
struct BestOf([BrdfParams; 2]);

/// Every so many-th measurement is held out.
const HELD_OUT: usize = 10;

impl Fit for BestOf {
    fn fit(&self, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<Box<dyn Brdf>> {
        let rows = 0..pairs.len().min(values.nrows());
        let (test, train): (Vec<usize>, Vec<usize>) = rows.partition(|row| row % HELD_OUT == 0);
        let select = |rows: &[usize]| -> (Vec<Pair>, Array2<f64>) {
            let pairs = rows.iter().map(|&row| pairs[row]).collect();
            (pairs, values.select(Axis(0), rows))
        };
        let ((train_pairs, train_values), (test_pairs, truth)) = (select(&train), select(&test));
        let error = |params: &BrdfParams| -> Result<f64> {
            let found = params
                .fit(&train_pairs, train_values.view())?
                .eval(&test_pairs)?;
            // Differences of the logarithm of cosine-weighted values, as the eye sees them.
            let rows = found.rows().into_iter().zip(truth.rows()).zip(&test_pairs);
            Ok(rows
                .flat_map(|((found, truth), pair)| {
                    let seen = |value: f64| (value.max(0.0) * pair.incident[2]).ln_1p();
                    let differences = found
                        .iter()
                        .zip(truth)
                        .map(move |(f, t)| seen(*f) - seen(*t));
                    differences.map(f64::abs).collect::<Vec<_>>()
                })
                .sum())
        };
        let [first, second] = &self.0;
        let best = if error(second)? < error(first)? {
            second
        } else {
            first
        };
        best.fit(pairs, values)
    }
}

/// The stand-in's seed.
const STAND_IN_SEED: u64 = 1;

/// What measurements are turned into: the values of a scene's `fit`.
enum Method<'a> {
    Network(&'a Recipe, Option<usize>),
    Interpolation,
    Formula(reference::Analytic),
}

impl Library {
    /// The method that a scene asks for.
    fn method(&self, material: &scene::Material) -> Result<Method<'_>> {
        match material.fit.as_deref() {
            None | Some("elm") => Ok(Method::Network(&*self.network, material.neurons)),
            Some("interpolation") => Ok(Method::Interpolation),
            Some(name) => reference::Analytic::ALL
                .into_iter()
                .find(|family| family.name() == name)
                .map(Method::Formula)
                .ok_or_else(|| Error::UnknownName {
                    what: "fit",
                    name: name.to_owned(),
                    expected: format!(
                        "elm, interpolation, {}",
                        reference::Analytic::ALL
                            .map(reference::Analytic::name)
                            .join(", ")
                    ),
                }),
        }
    }

    /// The measurements of a material of CUReT or of the stand-in, and what a caption calls them.
    fn measurements(&self, name: &str) -> Result<(Measurements, &'static str)> {
        let id = match (&self.curet, name.parse()) {
            // A scene made for CUReT renders with the stand-in too, which has names of its own.
            (None, Err(_)) => synthetic::find(name)?,
            (_, found) => found?,
        };
        Ok(match &self.curet {
            Some(dir) => (curet::read(dir, &[id], Invalid::Clamp)?, "CUReT"),
            None => (
                synthetic::measurements(STAND_IN_SEED, &[id], Invalid::Clamp),
                "the synthetic stand-in",
            ),
        })
    }
}

impl Method<'_> {
    fn fit(&self, samples: &Samples, data: &str) -> Result<Supplied> {
        let pairs = pairs(&samples.directions);
        let values = samples.values.view();
        let (brdf, how) = match self {
            Self::Network(recipe, neurons) => {
                let fit = recipe(pairs.len(), *neurons);
                (fit.fit(&pairs, values)?, "ELM fitted to".to_owned())
            }
            Self::Interpolation => {
                let interpolation = reference::RadialBasis {
                    features: Features::ReciprocalCosines,
                    link: Link::default_log(),
                    radial: reference::Radial::ThinPlate,
                    smoothing: reference::Smoothing::Exact,
                };
                (
                    interpolation.fit(&pairs, values)?,
                    "interpolated".to_owned(),
                )
            }
            Self::Formula(family) => (
                family.fit(&pairs, values)?,
                format!("{} fitted to", family.name()),
            ),
        };
        Ok(Supplied {
            brdf,
            origin: format!("{how} {data}"),
            name: None,
            notes: Vec::new(),
        })
    }
}

impl Supply for Library {
    fn supply(&self, material: &scene::Material, dir: &Path) -> Result<Supplied> {
        let scene::Material {
            curet,
            csv,
            model,
            analytic,
            ..
        } = material;
        match (curet, csv, model, analytic) {
            (Some(name), None, None, None) => {
                let method = self.method(material)?;
                let (measurements, data) = self.measurements(name)?;
                let samples = measurements
                    .samples(0)
                    .ok_or_else(|| no_measurements(data))?;
                let material = measurements
                    .materials
                    .first()
                    .ok_or_else(|| no_measurements(data))?;
                let title = format!("{} {}", material.id, material.name);
                Ok(Supplied {
                    name: Some(title),
                    ..method.fit(&samples, data)?
                })
            }
            (None, Some(file), None, None) => {
                let method = self.method(material)?;
                let (samples, notes) = read(&dir.join(file), material)?;
                Ok(Supplied {
                    notes,
                    ..method.fit(&samples, &file.display().to_string())?
                })
            }
            (None, None, Some(file), None) => {
                let path = dir.join(file);
                let model: BrdfModel = crate::file::load(&path)?;
                Ok(Supplied {
                    origin: format!("{} ({})", file.display(), model.provenance().data),
                    name: None,
                    brdf: Box::new(model.in_rgb_order()?),
                    notes: Vec::new(),
                })
            }
            (None, None, None, Some(name)) => Ok(Supplied {
                brdf: Box::new(Analytic::from_scene(name, material)?),
                origin: "a formula".to_owned(),
                name: None,
                notes: Vec::new(),
            }),
            _ => Err(Error::MaterialSource),
        }
    }
}

fn no_measurements(data: &str) -> Error {
    Error::UnknownName {
        what: "measurements",
        name: data.to_owned(),
        expected: "205 of them".to_owned(),
    }
}

/// Samples from a file, read as every command reads it, with red before green before blue; and
/// what was assumed of them.
fn read(path: &Path, material: &scene::Material) -> Result<(Samples, Vec<String>)> {
    let weighted = material.cosine_weighted.as_deref();
    if let Some(other) = weighted.filter(|angle| !["theta_i", "theta_o"].contains(angle)) {
        return Err(Error::UnknownName {
            what: "cosine",
            name: other.to_owned(),
            expected: "theta_i, theta_o".to_owned(),
        });
    }
    let invalid: Invalid = match &material.invalid {
        Some(way) => way.parse()?,
        None => Invalid::default(),
    };
    let options = OpenOptions {
        scattered: scattered::Options {
            unit: if material.degrees {
                AngleUnit::Degrees
            } else {
                AngleUnit::Radians
            },
            cosine_weighted: weighted == Some("theta_i"),
        },
        columns: scattered::Columns {
            channels: material.channels.clone(),
            ignore: material.ignore.clone(),
            scatter_cosine: weighted == Some("theta_o"),
        },
        invalid,
        ..OpenOptions::default()
    };
    let opened = elm_datasets::open(path, &options)?;
    let mut notes: Vec<String> = opened.notes.iter().map(ToString::to_string).collect();
    if opened.missing > 0 {
        notes.push(format!(
            "{} values are missing, {} measurements were left out",
            opened.missing, opened.left_out
        ));
    }
    let noted = |note| format!("{}: {note}", path.display());
    let notes = notes.into_iter().map(noted).collect();
    Ok((opened.samples.in_rgb_order(), notes))
}

/// A pair in angles.
fn angles(pair: &Pair) -> Directions {
    let polar = |w: [f64; 3]| (w[0].hypot(w[1]).atan2(w[2]), w[1].atan2(w[0]));
    let ((theta_i, phi_i), (theta_o, phi_o)) = (polar(pair.incident), polar(pair.outgoing));
    Directions {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    }
}

/// A formula of one channel: a diffuse part and a highlight, from [`elm_datasets::analytic`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Analytic {
    diffuse: Diffuse,
    highlight: Option<Highlight>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Diffuse {
    Lambert { albedo: f64 },
    OrenNayar { albedo: f64, sigma: f64 },
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Highlight {
    Ward { albedo: f64, alpha: f64 },
    Ggx { f0: f64, alpha: f64 },
}

impl Analytic {
    /// A surface that looks equally bright from everywhere.
    #[must_use]
    pub fn lambert(albedo: f64) -> Self {
        Self {
            diffuse: Diffuse::Lambert { albedo },
            highlight: None,
        }
    }

    fn from_scene(name: &str, material: &scene::Material) -> Result<Self> {
        let value = |what, given: Option<f64>, default: f64, least: f64, most: f64| {
            let value = given.unwrap_or(default);
            if (least..=most).contains(&value) {
                return Ok(value);
            }
            Err(Error::AnalyticValue {
                what,
                value,
                least,
                most,
            })
        };
        let albedo = value("albedo", material.albedo, 0.5, 0.0, 1.0)?;
        let roughness = value("roughness", material.roughness, 0.3, 1e-3, 2.0)?;
        let specular = value("specular", material.specular, 0.04, 0.0, 1.0)?;
        let (diffuse, highlight) = match name {
            "lambert" => (Diffuse::Lambert { albedo }, None),
            "oren-nayar" => {
                let sigma = roughness;
                (Diffuse::OrenNayar { albedo, sigma }, None)
            }
            "ward" => {
                let highlight = Highlight::Ward {
                    albedo: specular,
                    alpha: roughness,
                };
                (Diffuse::Lambert { albedo }, Some(highlight))
            }
            "ggx" => {
                let highlight = Highlight::Ggx {
                    f0: specular,
                    alpha: roughness,
                };
                (Diffuse::Lambert { albedo }, Some(highlight))
            }
            _ => {
                return Err(Error::UnknownName {
                    what: "formula",
                    name: name.to_owned(),
                    expected: "lambert, oren-nayar, ward, ggx".to_owned(),
                });
            }
        };
        Ok(Self { diffuse, highlight })
    }
}

impl Brdf for Analytic {
    fn channels(&self) -> usize {
        1
    }

    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>> {
        Ok(Array2::from_shape_fn((pairs.len(), 1), |(row, _)| {
            let directions = angles(&pairs[row]);
            let diffuse = match self.diffuse {
                Diffuse::Lambert { albedo } => analytic::lambert(&directions, albedo),
                Diffuse::OrenNayar { albedo, sigma } => {
                    analytic::oren_nayar(&directions, albedo, sigma)
                }
            };
            let highlight = match self.highlight {
                None => 0.0,
                Some(Highlight::Ward { albedo, alpha }) => {
                    analytic::ward(&directions, albedo, alpha)
                }
                Some(Highlight::Ggx { f0, alpha }) => analytic::ggx(&directions, f0, alpha),
            };
            diffuse + highlight
        }))
    }

    fn floats_per_channel(&self) -> usize {
        let diffuse = match self.diffuse {
            Diffuse::Lambert { .. } => 1,
            Diffuse::OrenNayar { .. } => 2,
        };
        diffuse + if self.highlight.is_some() { 2 } else { 0 }
    }
}
