//! k-fold cross-validation of anything that can be fitted to measurements.

use elm::metrics;
use elm_datasets::{Directions, Material, MaterialId, Measurements};
use ndarray::{Array1, Array2, Axis, concatenate};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::brdf::Fit;
use crate::error::{Error, Result};
use crate::geometry::Pair;

/// Which fold each measurement is held out in: a seeded shuffle, dealt into folds whose sizes
/// differ by at most one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folds {
    count: usize,
    of_row: Vec<usize>,
}

impl Folds {
    /// Deals `rows` measurements into `count` folds.
    ///
    /// # Errors
    /// [`Error::Folds`] unless `count` is 2 to `rows`.
    pub fn new(rows: usize, count: usize, seed: u64) -> Result<Self> {
        if count < 2 || count > rows {
            return Err(Error::Folds { folds: count, rows });
        }
        let mut order: Vec<usize> = (0..rows).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // The hidden layer is drawn from stream 0 of the same seed.
        random.set_stream(1);
        order.shuffle(&mut random);
        let mut of_row = vec![0; rows];
        for (place, row) in order.into_iter().enumerate() {
            of_row[row] = place % count;
        }
        Ok(Self { count, of_row })
    }

    /// Number of folds.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The fold that a measurement is held out in.
    #[must_use]
    pub fn of_row(&self, row: usize) -> usize {
        self.of_row[row]
    }
}

/// Measures of error of a set of predictions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Root mean squared error in 1/sr.
    pub rmse: f64,
    /// Mean absolute error in 1/sr.
    pub mae: f64,
    /// Pearson's correlation coefficient; `None` where it does not exist.
    pub correlation: Option<f64>,
}

impl Metrics {
    fn of(predicted: &Array1<f64>, truth: &Array1<f64>) -> Result<Self> {
        Ok(Self {
            rmse: metrics::rmse(predicted, truth)?,
            mae: metrics::mae(predicted, truth)?,
            correlation: metrics::correlation(predicted, truth)?,
        })
    }

    /// The mean of each measure over those folds that have it.
    fn mean(folds: &[Self]) -> Self {
        let mean = |values: Vec<f64>| {
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let (rmse, mae) = folds.iter().map(|fold| (fold.rmse, fold.mae)).unzip();
        Self {
            rmse: mean(rmse).unwrap_or(0.0),
            mae: mean(mae).unwrap_or(0.0),
            correlation: mean(folds.iter().filter_map(|fold| fold.correlation).collect()),
        }
    }
}

/// What cross-validation found for one channel of one material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scores {
    /// Over the training rows of all folds together: each measurement counts once for every fold
    /// that trained on it.
    pub train: Metrics,
    /// Over all held-out predictions together: each measurement counts once.
    pub held_out: Metrics,
    /// The mean over folds of each fold's held-out measures.
    pub held_out_fold_mean: Metrics,
}

/// The scores of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialScores {
    /// The material.
    pub id: MaterialId,
    /// Its name.
    pub name: String,
    /// One entry per channel of the measurements.
    pub channels: Vec<Scores>,
}

/// Cross-validates `method` on every material, and calls `done` after each fit with the number of
/// fits so far and in all.
///
/// Materials measured at the same directions are fitted together, fold by fold: an extreme
/// learning machine then factorises one hidden-layer matrix per fold, however many materials
/// there are.
///
/// # Errors
/// Those of the method; [`Error::Folds`] when `folds` was made for another number of
/// measurements.
pub fn cross_validate(
    method: &dyn Fit,
    data: &Measurements,
    folds: &Folds,
    mut done: impl FnMut(usize, usize),
) -> Result<Vec<MaterialScores>> {
    if folds.of_row.len() != data.directions.len() {
        return Err(Error::Folds {
            folds: folds.count,
            rows: data.directions.len(),
        });
    }
    let groups = groups(&data.materials);
    let fits = groups.len() * folds.count;
    let mut scores: Vec<Option<MaterialScores>> = vec![None; data.materials.len()];
    for (g, members) in groups.iter().enumerate() {
        let materials: Vec<&Material> = members.iter().map(|&m| &data.materials[m]).collect();
        let group = Group::new(&materials, &data.directions)?;
        let columns =
            group.cross_validate(method, folds, |fold| done(g * folds.count + fold, fits))?;
        let mut columns = columns.into_iter();
        for (&member, material) in members.iter().zip(&materials) {
            let channels = columns.by_ref().take(material.values.ncols()).collect();
            scores[member] = Some(MaterialScores {
                id: material.id,
                name: material.name.clone(),
                channels,
            });
        }
    }
    Ok(scores.into_iter().flatten().collect())
}

/// Indices of the materials that were measured at the same directions, in order of appearance.
fn groups(materials: &[Material]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, material) in materials.iter().enumerate() {
        match groups
            .iter_mut()
            .find(|group| materials[group[0]].rows == material.rows)
        {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

/// Materials measured at the same directions, side by side.
struct Group<'a> {
    /// Index of each measurement in the whole rig.
    rows: &'a [usize],
    pairs: Vec<Pair>,
    /// Shape (rows, channels of all materials).
    values: Array2<f64>,
}

impl<'a> Group<'a> {
    fn new(materials: &[&'a Material], directions: &[Directions]) -> Result<Self> {
        let rows: &[usize] = materials.first().map_or(&[], |material| &material.rows);
        let views: Vec<_> = materials
            .iter()
            .map(|material| material.values.view())
            .collect();
        let values = concatenate(Axis(1), &views).map_err(|_| elm::Error::Empty {
            what: "measurements",
            rows: rows.len(),
            columns: 0,
        })?;
        Ok(Self {
            rows,
            pairs: rows
                .iter()
                .map(|&row| Pair::from(&directions[row]))
                .collect(),
            values,
        })
    }

    /// Scores of each column.
    fn cross_validate(
        &self,
        method: &dyn Fit,
        folds: &Folds,
        mut done: impl FnMut(usize),
    ) -> Result<Vec<Scores>> {
        let mut train = Predictions::default();
        let mut held_out = Predictions::default();
        let mut fold_metrics: Vec<Vec<Metrics>> = vec![Vec::new(); self.values.ncols()];
        for fold in 0..folds.count {
            let (test_rows, train_rows): (Vec<usize>, Vec<usize>) =
                (0..self.rows.len()).partition(|&r| folds.of_row(self.rows[r]) == fold);
            let select = |rows: &[usize]| -> (Vec<Pair>, Array2<f64>) {
                let pairs = rows.iter().map(|&row| self.pairs[row]).collect();
                (pairs, self.values.select(Axis(0), rows))
            };
            let (train_pairs, train_values) = select(&train_rows);
            let model = method.fit(&train_pairs, train_values.view())?;
            train.push(model.eval(&train_pairs)?, train_values);
            // Where invalid values are dropped a fold may hold none of a material's rows.
            if !test_rows.is_empty() {
                let (test_pairs, truth) = select(&test_rows);
                let predicted = model.eval(&test_pairs)?;
                for (column, metrics) in fold_metrics.iter_mut().enumerate() {
                    let (p, t) = (predicted.column(column), truth.column(column));
                    metrics.push(Metrics::of(&p.to_owned(), &t.to_owned())?);
                }
                held_out.push(predicted, truth);
            }
            done(fold + 1);
        }
        let (train, held_out) = (train.metrics()?, held_out.metrics()?);
        let columns = train.into_iter().zip(held_out).zip(fold_metrics);
        Ok(columns
            .map(|((train, held_out), folds)| Scores {
                train,
                held_out,
                held_out_fold_mean: Metrics::mean(&folds),
            })
            .collect())
    }
}

/// Predictions and truths of several folds.
#[derive(Default)]
struct Predictions {
    predicted: Vec<Array2<f64>>,
    truth: Vec<Array2<f64>>,
}

impl Predictions {
    fn push(&mut self, predicted: Array2<f64>, truth: Array2<f64>) {
        self.predicted.push(predicted);
        self.truth.push(truth);
    }

    /// The metrics of each column over all folds.
    fn metrics(&self) -> Result<Vec<Metrics>> {
        let columns = self.truth.first().map_or(0, Array2::ncols);
        let column = |parts: &[Array2<f64>], c: usize| -> Array1<f64> {
            parts
                .iter()
                .flat_map(|part| part.column(c).to_vec())
                .collect()
        };
        (0..columns)
            .map(|c| Metrics::of(&column(&self.predicted, c), &column(&self.truth, c)))
            .collect()
    }
}
