//! Pictures of what a cross-validation found, each as SVG and as PNG.
//!
//! | file | what it shows |
//! |---|---|
//! | `predicted-against-measured` | every held-out prediction over its measurement |
//! | `error-by-angle` | root mean squared error in steps of 10 degrees |
//! | `error-by-material` | each material's error beside the paper's and the noise floor |
//! | `pareto` | error over time per evaluation, with the front |
//! | `lobes` | reflectance in the plane of incidence, measurements on the model's curves |
//!
//! Colours are those of M. Okabe and K. Ito, *Color Universal Design*, 2008, which the colour
//! blind tell apart; series differ by shape too.

mod angle;
mod bars;
mod front;
mod lobes;
mod scatter;

use std::fmt::Display;
use std::io::{self, Cursor};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use elm_datasets::{Measurements, Origin};
use image::{ImageFormat, RgbImage};
use ndarray::ArrayView2;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

use super::paper;
use crate::error::{Error, Result};
use crate::file;
use crate::fit::Fit;
use crate::pareto::CostPoint;
use crate::protocol::MaterialScores;
use crate::statistics::mean;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const VERMILION: RGBColor = RGBColor(213, 94, 0);
pub(super) const GRAY: RGBColor = RGBColor(120, 120, 120);
pub(super) const PALE: RGBColor = RGBColor(222, 222, 222);

/// A picture of lobes has no more panels than the paper has materials.
const MAX_PANELS: usize = 15;

/// Measurements of one material, with a prediction of each that was held out when it was made.
#[derive(Debug, Clone)]
pub struct PredictionPlot<'a> {
    /// The material's name.
    pub name: String,
    /// The pairs of directions.
    pub pairs: Vec<DirectionPair>,
    /// BRDF in 1/sr, shape (pairs, channels).
    pub measured: ArrayView2<'a, f64>,
    /// The same, predicted.
    pub predicted: ArrayView2<'a, f64>,
    /// Root mean squared error in 1/sr, mean over the channels.
    pub rmse: f64,
    /// The paper's, mean over the channels; `None` where it prints none.
    pub paper: Option<f64>,
    /// The standard deviation of a measurement in 1/sr, where it is known.
    pub noise_floor: Option<f64>,
}

impl<'a> PredictionPlot<'a> {
    /// Samples of one material, with what a cross-validation predicted.
    #[must_use]
    pub fn new(
        name: String,
        directions: &[DirectionPair],
        measured: ArrayView2<'a, f64>,
        scores: &'a MaterialScores,
    ) -> Self {
        let channels = || scores.channels.iter();
        let floors = channels().filter_map(|channel| channel.noise_floor);
        Self {
            name,
            pairs: directions.to_vec(),
            measured,
            predicted: scores.predicted.view(),
            rmse: mean(channels().map(|channel| channel.held_out.rmse)).unwrap_or(0.0),
            paper: None,
            noise_floor: mean(floors.map(|floor| floor.sigma)),
        }
    }

    /// Many materials, with what a cross-validation predicted and the paper printed.
    #[must_use]
    pub fn of(data: &'a Measurements, scores: &'a [MaterialScores]) -> Vec<Self> {
        let materials = data.materials.iter().enumerate().zip(scores);
        let shown = materials.filter_map(|((index, material), scores)| {
            let printed = data
                .channels
                .iter()
                .filter_map(|channel| paper(material.id, channel, data.origin == Origin::Curet));
            Some(Self {
                paper: mean(printed.map(|paper| paper.rmse)),
                ..Self::new(
                    format!("{} {}", material.id, material.name),
                    &data.samples(index)?.directions,
                    material.values.view(),
                    scores,
                )
            })
        });
        shown.collect()
    }
}

/// Draws the first three pictures into `dir`, which is made if need be, and returns the files.
/// `title` is said in every picture: the data and the model.
///
/// # Errors
/// [`Error::Write`] naming the file or folder.
pub fn write(dir: &Path, title: &str, materials: &[PredictionPlot<'_>]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let scatter = scatter::Scatter::new(title, materials);
    files.extend(save(&scatter, dir, "predicted-against-measured")?);
    let angle = angle::ByAngle::new(title, materials);
    files.extend(save(&angle, dir, "error-by-angle")?);
    let bars = bars::Bars::new(title, materials);
    files.extend(save(&bars, dir, "error-by-material")?);
    Ok(files)
}

/// Draws the error of models over their time per evaluation, as `pareto`, into `dir`, which is made
/// if need be, and returns the files.
///
/// # Errors
/// [`Error::Write`] naming the file or folder.
pub fn write_front(
    dir: &Path,
    title: &str,
    error: &str,
    points: &[CostPoint],
) -> Result<Vec<PathBuf>> {
    save(&front::Front::new(title, error, points), dir, "pareto")
}

/// One panel of [`write_lobes`]: a material as a fitted model has it.
pub struct Panel<'a> {
    /// The material's name.
    pub name: String,
    /// The model.
    pub model: &'a dyn Brdf,
    /// Which of the model's channels belong to the material; their mean is drawn.
    pub channels: Range<usize>,
    /// The pairs of directions that were measured.
    pub pairs: &'a [DirectionPair],
    /// BRDF in 1/sr, shape (pairs, channels of the material).
    pub measured: ArrayView2<'a, f64>,
}

/// Draws `lobes` into `dir`, which is made if need be, and returns the files.
///
/// # Errors
/// Those of the model; [`Error::Write`] naming the file or folder.
pub fn write_lobes(dir: &Path, title: &str, panels: &[Panel<'_>]) -> Result<Vec<PathBuf>> {
    let lobes = lobes::Lobes::new(title, panels)?;
    save(&lobes, dir, "lobes")
}

/// Fits `method` to each of the first 15 materials and draws their [lobes](write_lobes).
///
/// # Errors
/// Those of the method; [`Error::Write`] naming the file or folder.
pub fn write_fitted_lobes(
    dir: &Path,
    title: &str,
    data: &Measurements,
    method: &(impl Fit + ?Sized),
) -> Result<Vec<PathBuf>> {
    let mut fitted = Vec::new();
    for (index, material) in data.materials.iter().take(MAX_PANELS).enumerate() {
        let Some(samples) = data.samples(index) else {
            continue;
        };
        let model = method.fit(&samples.directions, samples.values.view())?;
        fitted.push((material, samples.directions, model));
    }
    let panels: Vec<Panel<'_>> = fitted
        .iter()
        .map(|(material, pairs, model)| Panel {
            name: format!("{} {}", material.id, material.name),
            model,
            channels: 0..material.values.ncols(),
            pairs,
            measured: material.values.view(),
        })
        .collect();
    write_lobes(dir, title, &panels)
}

/// The pictures that [`write`] and [`write_lobes`] make, without extensions.
#[cfg(feature = "cli")]
pub(crate) const NAMES: [&str; 4] = [
    "predicted-against-measured",
    "error-by-angle",
    "error-by-material",
    "lobes",
];

/// What drawing comes to on a back end.
type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

/// A picture that can be drawn on any back end.
trait Chart {
    /// Width and height in pixels.
    fn size(&self) -> (u32, u32);

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB>;
}

/// Writes a chart as SVG and as PNG; each file appears whole or not at all.
fn save(chart: &impl Chart, dir: &Path, name: &str) -> Result<Vec<PathBuf>> {
    font();
    let failed = |path: &Path, reason| Error::Write {
        path: path.to_owned(),
        reason,
    };
    file::folder(dir)?;
    let (vector, bitmap) = (
        dir.join(format!("{name}.svg")),
        dir.join(format!("{name}.png")),
    );
    let svg = svg(chart).map_err(|reason| failed(&vector, reason))?;
    file::replace(&vector, svg.as_bytes())?;
    let png = png(chart).map_err(|reason| failed(&bitmap, reason))?;
    file::replace(&bitmap, &png)?;
    Ok(vec![vector, bitmap])
}

/// Makes the one font known to the drawing crate, once; without it there would be no text.
///
/// Whatever draws with `plotters` in this workspace has to call it first, as the crate's features
/// are the same for all.
pub fn font() {
    static DONE: OnceLock<()> = OnceLock::new();
    DONE.get_or_init(|| {
        // The embedded font is one that can be read.
        let _ = register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
}

fn other(error: impl Display) -> io::Error {
    io::Error::other(error.to_string())
}

fn svg(chart: &impl Chart) -> io::Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, chart.size()).into_drawing_area();
        area.fill(&WHITE).map_err(other)?;
        chart.draw(&area).map_err(other)?;
        area.present().map_err(other)?;
    }
    Ok(text)
}

fn png(chart: &impl Chart) -> io::Result<Vec<u8>> {
    let (width, height) = chart.size();
    let mut pixels = vec![0; width as usize * height as usize * 3];
    {
        let area = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        area.fill(&WHITE).map_err(other)?;
        chart.draw(&area).map_err(other)?;
        area.present().map_err(other)?;
    }
    let image = RgbImage::from_raw(width, height, pixels)
        .ok_or_else(|| io::Error::other("a picture of the wrong size"))?;
    let mut bytes = Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(io::Error::other)?;
    Ok(bytes.into_inner())
}

/// Draws two lines of text on top and returns the remaining area.
fn titled<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    what: &str,
    title: &str,
) -> Result<DrawingArea<DB, Shift>, DrawingAreaErrorKind<DB::ErrorType>> {
    area.draw_text(what, &("sans-serif", 20).into_text_style(area), (14, 10))?;
    let small = ("sans-serif", 13).into_text_style(area).color(&GRAY);
    area.draw_text(title, &small, (14, 36))?;
    Ok(area.margin(60, 0, 0, 0))
}

/// A round step of at most a fifth of `length`: 1, 2 or 5 times a power of ten.
fn round_step(length: f64) -> f64 {
    let power = 10.0_f64.powf((length / 5.0).log10().floor());
    let factor = [5.0, 2.0].into_iter().find(|f| f * power <= length / 5.0);
    power * factor.unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::Analytic;
    use crate::protocol::{Folds, cross_validate};
    use elm_datasets::{Invalid, MaterialId, synthetic};

    #[test]
    fn every_picture_is_written_in_both_forms_and_the_same_each_time() {
        let ids = [1, 39].map(|n| MaterialId::new(n).unwrap());
        let data = synthetic::measurements(1, &ids, Invalid::Clamp);
        let folds = Folds::new(data.directions.len(), 3, 1).unwrap();
        let scores = cross_validate(&Analytic::GgxLambert, &data, &folds, |_, _| {}).unwrap();
        let pairs = &data.directions;
        let shown: Vec<PredictionPlot<'_>> = data
            .materials
            .iter()
            .zip(&scores)
            .map(|(material, scores)| PredictionPlot {
                name: material.name.clone(),
                pairs: pairs.clone(),
                measured: material.values.view(),
                predicted: scores.predicted.view(),
                rmse: 0.01,
                paper: (material.id.number() == 39).then_some(0.02),
                noise_floor: None,
            })
            .collect();
        let values = &data.materials[1].values;
        let model = Analytic::GgxLambert.fit(pairs, values.view()).unwrap();
        let panel = Panel {
            name: "a panel".to_owned(),
            model: &model,
            channels: 0..3,
            pairs,
            measured: values.view(),
        };
        let dir = tempfile::tempdir().unwrap();
        let mut files = write(dir.path(), "synthetic, ggx", &shown).unwrap();
        files.extend(write_lobes(dir.path(), "synthetic, ggx", &[panel]).unwrap());
        assert_eq!(files.len(), 8);
        for file in &files {
            let bytes = std::fs::read(file).unwrap();
            if file.extension().unwrap() == "png" {
                let image = image::load_from_memory(&bytes).unwrap().to_rgb8();
                // Neither blank nor black: text and lines are a small share of the pixels.
                let ink = image
                    .pixels()
                    .filter(|p| p.0.iter().any(|&v| v < 128))
                    .count();
                let share = ink as f64 / f64::from(image.width() * image.height());
                assert!((0.002..0.4).contains(&share), "{}: {share}", file.display());
            } else {
                let text = String::from_utf8(bytes).unwrap();
                assert!(
                    text.starts_with("<svg") && text.contains("synthetic, ggx"),
                    "{text}"
                );
            }
        }
        let before = std::fs::read(&files[0]).unwrap();
        write(dir.path(), "synthetic, ggx", &shown).unwrap();
        assert_eq!(before, std::fs::read(&files[0]).unwrap());
    }

    #[test]
    fn nothing_to_show_is_a_picture_all_the_same() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(write(dir.path(), "nothing", &[]).unwrap().len(), 6);
        assert_eq!(write_lobes(dir.path(), "nothing", &[]).unwrap().len(), 2);
    }

    #[test]
    fn steps_are_round() {
        for (length, step) in [(1.0, 0.2), (0.26, 0.05), (0.5, 0.1), (70.0, 10.0)] {
            approx::assert_relative_eq!(round_step(length), step, max_relative = 1e-12);
        }
    }
}
