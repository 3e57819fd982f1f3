//! Loads the materials of scenes: fitted, saved, measured or analytic.

mod table;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use elm_brdf_render::{LoadError, LoadedMaterial, MaterialLoader};
use elm_datasets::Brdf;
use elm_datasets::brdf::EvalError;
use elm_datasets::color::SpectralColor;
use elm_datasets::geometry::DirectionPair;
use elm_datasets::scattered::{self, AngleUnit};
use elm_datasets::{Invalid, Measurements, OpenOptions, Samples, curet, synthetic};
use ndarray::ArrayViewMut2;

use crate::baselines;
use crate::batch::Packed;
use crate::error::{Error, Result};
use crate::export::check_precision;
use crate::features::Features;
use crate::fit::{Model, boxed};
use crate::model::BrdfModel;
use crate::recipes::{self, Recipe};
use crate::target_transform::TargetTransform;
use table::Source;
pub use table::{MaterialTable, measured_table};

/// A scene whose materials are described by [`MaterialTable`]s.
pub type Scene = elm_brdf_render::Scene<MaterialTable>;
/// A sheet of such scenes.
pub type Sheet = elm_brdf_render::Sheet<MaterialTable>;

/// A model and where it comes from, in a word: "CUReT", "synthetic", a file's name, "analytic".
pub struct Fitted {
    /// The model.
    pub model: Box<dyn Model>,
    /// The data.
    pub origin: String,
    /// What the data call the material, if they do.
    pub name: Option<String>,
    /// What was assumed of the data.
    pub notes: Vec<String>,
}

/// Models fitted to CUReT's files, to the synthetic data or to files of one's own, saved models, measured
/// tables, and formulas. What was made once is used again for the same table.
pub struct SceneMaterialLoader {
    /// Folder of CUReT's files; `None` for the synthetic data.
    curet: Option<PathBuf>,
    /// What fits a network, `fit = "elm"`.
    network: Box<Recipe>,
    made: Mutex<Vec<(MaterialTable, PathBuf, Slot)>>,
}

/// Held while a material is made, so that it is made once.
type Slot = Arc<Mutex<Option<Made>>>;

/// What a table came to.
#[derive(Clone)]
struct Made {
    brdf: Arc<dyn Brdf>,
    multiply_adds: usize,
    origin: String,
    name: Option<String>,
    notes: Vec<String>,
}

/// The seed of the synthetic data.
const SYNTHETIC_SEED: u64 = 1;

impl SceneMaterialLoader {
    /// With CUReT's files in a folder, or with the synthetic data, and the networks of
    /// [`recipes::network`].
    #[must_use]
    pub fn new(curet: Option<PathBuf>) -> Self {
        Self::with_network(curet, Box::new(recipes::network))
    }

    /// The same with other networks.
    #[must_use]
    pub fn with_network(curet: Option<PathBuf>, network: Box<Recipe>) -> Self {
        Self {
            curet,
            network,
            made: Mutex::default(),
        }
    }

    /// The model that a table asks for; its files are relative to `dir`.
    ///
    /// # Errors
    /// [`Error::MaterialSource`] for a table or a formula, which are no models, and unless exactly one
    /// source is named; whatever reading and fitting report.
    pub fn model(&self, table: &MaterialTable, dir: &Path) -> Result<Fitted> {
        match table.source()? {
            Source::Curet(name) => {
                let (measurements, data) = self.measurements(name)?;
                let material = measurements.materials.first();
                let (Some(samples), Some(material)) = (measurements.samples(0), material) else {
                    return Err(no_measurements(data));
                };
                Ok(Fitted {
                    name: Some(format!("{} {}", material.id, material.name)),
                    ..self.fitted(table, &samples, data)?
                })
            }
            Source::Samples(file) => {
                let (samples, notes) = read(&dir.join(file), table)?;
                Ok(Fitted {
                    notes,
                    ..self.fitted(table, &samples, &file.display().to_string())?
                })
            }
            Source::Model(file) => {
                let model: BrdfModel = crate::file::load(&dir.join(file))?;
                Ok(Fitted {
                    origin: format!("{} ({})", file.display(), model.provenance().data),
                    name: None,
                    model: Box::new(model.in_color()?),
                    notes: Vec::new(),
                })
            }
            Source::Table(_) | Source::Formula(_) => Err(Error::MaterialSource),
        }
    }

    fn fitted(&self, table: &MaterialTable, samples: &Samples, data: &str) -> Result<Fitted> {
        let (method, how) = match table.fit.as_deref() {
            None | Some("elm") => ((self.network)(table.neurons), "ELM fitted to".to_owned()),
            Some("interpolation") => {
                let interpolation = baselines::RadialBasis {
                    features: Features::ReciprocalCosines,
                    transform: TargetTransform::default_log(),
                    radial: baselines::Radial::ThinPlate,
                    smoothing: baselines::Smoothing::Exact,
                };
                (boxed(interpolation), "interpolated".to_owned())
            }
            Some(name) => {
                let all = baselines::Analytic::ALL;
                let family = all.into_iter().find(|family| family.name() == name);
                let family = family.ok_or_else(|| Error::UnknownName {
                    what: "fit",
                    name: name.to_owned(),
                    expected: format!(
                        "elm, interpolation, {}",
                        all.map(baselines::Analytic::name).join(", ")
                    ),
                })?;
                (boxed(family), format!("{name} fitted to"))
            }
        };
        let (samples, color) = (samples, SpectralColor::of(&samples.channels));
        let model = match (
            table.fit.as_deref(),
            color.map_err(elm_datasets::Error::from)?,
        ) {
            // A network of all wavelengths has their colour.
            (None | Some("elm"), Some(_)) => recipes::in_color(&*method, samples)?,
            (_, Some(_)) => {
                let samples = samples
                    .clone()
                    .in_color()
                    .map_err(elm_datasets::Error::from)?;
                method.fit(&samples.directions, samples.values.view())?
            }
            (_, None) => method.fit(&samples.directions, samples.values.view())?,
        };
        Ok(Fitted {
            model,
            origin: format!("{how} {data}"),
            name: None,
            notes: Vec::new(),
        })
    }

    /// The measurements of a material of CUReT or of the synthetic data, and what a caption calls them.
    fn measurements(&self, name: &str) -> Result<(Measurements, &'static str)> {
        let id = match (&self.curet, name.parse()) {
            // A scene made for CUReT renders with the synthetic data too, which has names of its own.
            (None, Err(_)) => synthetic::find(name)?,
            (_, found) => found?,
        };
        Ok(match &self.curet {
            Some(dir) => (curet::read(dir, &[id], Invalid::Clamp)?, "CUReT"),
            None => (
                synthetic::measurements(SYNTHETIC_SEED, &[id], Invalid::Clamp),
                "synthetic data",
            ),
        })
    }

    /// Room for what a table comes to, the same for the same table.
    fn slot(&self, table: MaterialTable, dir: &Path) -> Slot {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let same = |known: &&(MaterialTable, PathBuf, Slot)| known.0 == table && known.1 == dir;
        if let Some((_, _, slot)) = made.iter().find(same) {
            return slot.clone();
        }
        let slot = Slot::default();
        made.push((table, dir.to_owned(), slot.clone()));
        slot
    }

    fn make(&self, table: &MaterialTable, dir: &Path) -> Result<Made> {
        let plain = |brdf: Arc<dyn Brdf>, origin: String| Made {
            brdf,
            multiply_adds: 0,
            origin,
            name: None,
            notes: Vec::new(),
        };
        match table.source()? {
            Source::Table(file) => {
                let brdf = Arc::from(measured_table(&dir.join(file), true)?.0);
                Ok(plain(brdf, format!("measured, {}", file.display())))
            }
            Source::Formula(name) => Ok(plain(
                Arc::new(table.formula(name)?),
                "a formula".to_owned(),
            )),
            _ => {
                let fitted = self.model(table, dir)?;
                Ok(Made {
                    multiply_adds: fitted.model.multiply_adds(),
                    brdf: packed(fitted.model),
                    origin: fitted.origin,
                    name: fitted.name,
                    notes: fitted.notes,
                })
            }
        }
    }
}

/// A network packed for long batches, any other model as it is. In single precision, which is nearly twice
/// as fast, where that adds no more to a model's own error than an export may, a quarter of it.
fn packed(model: Box<dyn Model>) -> Arc<dyn Brdf> {
    let Some(network) = BrdfModel::of(&*model) else {
        return Arc::new(model);
    };
    if check_precision(network).is_ok()
        && let Ok(packed) = Packed::<f32>::new(network)
    {
        return Arc::new(packed);
    }
    match Packed::<f64>::new(network) {
        Ok(packed) => Arc::new(packed),
        Err(_) => Arc::new(model),
    }
}

impl MaterialLoader<MaterialTable> for SceneMaterialLoader {
    fn load(&self, table: &MaterialTable, dir: &Path) -> Result<LoadedMaterial, LoadError> {
        let untinted = MaterialTable {
            tint: None,
            rotation: 0.0,
            conserve_energy: false,
            ..table.clone()
        };
        let slot = self.slot(untinted, dir);
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        let made = match &*slot {
            Some(made) => made.clone(),
            None => slot.insert(apart(|| self.make(table, dir))?).clone(),
        };
        if !table.rotation.is_finite() {
            let found = table.rotation;
            return Err(Error::Rotation { found }.into());
        }
        let turns = !made.brdf.is_isotropic() && table.rotation != 0.0;
        Ok(LoadedMaterial {
            brdf: Box::new(InScene {
                brdf: made.brdf,
                angle: turns.then(|| -table.rotation.to_radians()),
            }),
            multiply_adds: made.multiply_adds,
            tint: table.tint.unwrap_or([1.0; 3]),
            conserve_energy: table.conserve_energy,
            origin: made.origin,
            name: made.name,
            notes: made.notes,
        })
    }
}

/// Makes a material on a thread of its own, and as many below it as there are here.
///
/// A worker of the renderer asks for it, and holds locks. Waiting for other threads the library's way it
/// would take up another tile meanwhile, which may wait for these very locks.
fn apart(make: impl FnOnce() -> Result<Made> + Send) -> Result<Made> {
    let threads = elm::current_threads();
    let work = || elm::on_threads(threads, make)?;
    let joined = std::thread::scope(|scope| scope.spawn(work).join());
    joined.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// A model that is asked for pairs turned about the normal, and answers on the worker that asks.
struct InScene {
    brdf: Arc<dyn Brdf>,
    /// In radians, where it is turned.
    angle: Option<f64>,
}

impl Brdf for InScene {
    fn channels(&self) -> usize {
        self.brdf.channels()
    }

    fn is_isotropic(&self) -> bool {
        self.brdf.is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        let turned = |angle| pairs.iter().map(move |pair| pair.turned(angle)).collect();
        let turned: Option<Vec<DirectionPair>> = self.angle.map(turned);
        let pairs = turned.as_deref().unwrap_or(pairs);
        elm::on_this_thread(|| self.brdf.eval_into(pairs, values))
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
fn read(path: &Path, material: &MaterialTable) -> Result<(Samples, Vec<String>)> {
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
            wavelengths: material.wavelengths.clone(),
            ..scattered::Columns::default()
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
