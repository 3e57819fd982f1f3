//! Measures of error of classes and their probabilities.

use ndarray::{Array2, ArrayRef2, ArrayView1};

use crate::check::{check_finite, check_length, check_some};
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::stats::sum;

/// The share of labels that are right.
///
/// ```
/// assert_eq!(elm::metrics::accuracy(&["a", "b", "b", "b"], &["a", "b", "b", "a"])?, 0.75);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// # Errors
/// [`Error::Shape`] when the lengths differ, [`Error::Empty`] of nothing.
#[doc(alias = "accuracy_score")]
pub fn accuracy<L: PartialEq>(predicted: &[L], truth: &[L]) -> Result<f64> {
    check_labels(predicted.len(), truth.len())?;
    let right = predicted.iter().zip(truth).filter(|(p, t)| p == t).count();
    Ok(right as f64 / truth.len() as f64)
}

/// The mean over the classes of `truth` of the share of their rows that are right.
///
/// ```
/// assert_eq!(elm::metrics::balanced_accuracy(&[1, 1, 1, 1], &[1, 1, 1, 2])?, 0.5);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// # Errors
/// Those of [`accuracy`].
#[doc(alias = "balanced_accuracy_score")]
pub fn balanced_accuracy<L: Ord>(predicted: &[L], truth: &[L]) -> Result<f64> {
    check_labels(predicted.len(), truth.len())?;
    let mut classes: Vec<&L> = truth.iter().collect();
    classes.sort_unstable();
    classes.dedup();
    let recall = |class: &&&L| {
        let rows = predicted.iter().zip(truth).filter(|(_, t)| t == *class);
        let (right, all) = rows.fold((0_usize, 0_usize), |(right, all), (p, t)| {
            (right + usize::from(p == t), all + 1)
        });
        right as f64 / all as f64
    };
    Ok(sum(classes.iter().map(|class| recall(&class))) / classes.len() as f64)
}

/// Rows of each true class (down) that each class (across) was predicted for, in the order of `classes`.
///
/// ```
/// use ndarray::array;
///
/// let counts = elm::metrics::confusion_matrix(&[1, 2, 2, 2], &[1, 1, 2, 2], &[1, 2])?;
/// assert_eq!(counts, array![[1, 1], [0, 2]]);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// # Errors
/// Those of [`accuracy`]; [`Error::UnknownClass`] for a label that is none of the classes.
pub fn confusion_matrix<L: PartialEq>(
    predicted: &[L],
    truth: &[L],
    classes: &[L],
) -> Result<Array2<u64>> {
    check_labels(predicted.len(), truth.len())?;
    let mut counts = Array2::zeros((classes.len(), classes.len()));
    for (row, (predicted, truth)) in predicted.iter().zip(truth).enumerate() {
        counts[[code(classes, truth, row)?, code(classes, predicted, row)?]] += 1;
    }
    Ok(counts)
}

/// The mean of $-\ln p$ of the true class. `probabilities` has shape (rows, classes), columns in the order of
/// `classes`; those below the type's epsilon count as it, and rows are divided by their sums.
///
/// ```
/// use ndarray::array;
///
/// let p = array![[0.5, 0.5], [0.25, 0.75]];
/// let loss = elm::metrics::log_loss(&p, &["a", "b"], &["a", "b"])?;
/// assert!((loss - 0.5 * (2_f64.ln() - 0.75_f64.ln())).abs() < 1e-15);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// # Errors
/// Those of [`accuracy`] and [`confusion_matrix`]; [`Error::NotFinite`] for a NaN.
pub fn log_loss<A: Scalar, L: PartialEq>(
    probabilities: &ArrayRef2<A>,
    truth: &[L],
    classes: &[L],
) -> Result<f64> {
    let codes = check_probabilities(probabilities, truth, classes)?;
    let least = A::epsilon().as_f64();
    let loss = |(p, &code): (ArrayView1<'_, A>, &usize)| {
        let whole: f64 = p.iter().map(|p| p.as_f64().max(least)).sum();
        -(p[code].as_f64().max(least) / whole).ln()
    };
    let losses = probabilities.rows().into_iter().zip(&codes).map(loss);
    Ok(sum(losses) / codes.len() as f64)
}

/// The mean over rows of $\sum_k (p_k - y_k)^2$ with $y$ 1 for the true class and 0 for others (Brier, 1950):
/// between 0 and 2.
///
/// # Errors
/// Those of [`log_loss`].
#[doc(alias = "brier_score_loss")]
pub fn brier_score<A: Scalar, L: PartialEq>(
    probabilities: &ArrayRef2<A>,
    truth: &[L],
    classes: &[L],
) -> Result<f64> {
    let codes = check_probabilities(probabilities, truth, classes)?;
    let squares = |(p, &code): (ArrayView1<'_, A>, &usize)| {
        let of =
            |(class, p): (usize, &A)| (p.as_f64() - f64::from(u8::from(class == code))).powi(2);
        p.iter().enumerate().map(of).sum::<f64>()
    };
    let squares = probabilities.rows().into_iter().zip(&codes).map(squares);
    Ok(sum(squares) / codes.len() as f64)
}

/// The area under the receiver operating characteristic of each class against the others, and the mean of
/// these: the probability that a row of the class has more of the column than a row of another, ties
/// counted half (Hanley and McNeil, 1982). Of two classes both are the same. Classes without rows, or without
/// others, are left out; nothing where that is all.
///
/// # Errors
/// Those of [`log_loss`].
#[doc(alias = "roc_auc_score")]
pub fn roc_auc<A: Scalar, L: PartialEq>(
    probabilities: &ArrayRef2<A>,
    truth: &[L],
    classes: &[L],
) -> Result<Option<f64>> {
    let codes = check_probabilities(probabilities, truth, classes)?;
    let areas = (0..classes.len()).filter_map(|class| {
        let p = probabilities.column(class);
        area(p, &codes, class)
    });
    let areas: Vec<f64> = areas.collect();
    let count = areas.len() as f64;
    Ok((!areas.is_empty()).then(|| sum(areas) / count))
}

/// By the sum of ranks of the rows of the class (Mann and Whitney).
fn area<A: Scalar>(p: ArrayView1<'_, A>, codes: &[usize], class: usize) -> Option<f64> {
    let mut order: Vec<usize> = (0..codes.len()).collect();
    order.sort_unstable_by(|&a, &b| p[a].as_f64().total_cmp(&p[b].as_f64()));
    let mut ranks = 0.0;
    let mut start = 0;
    for equal in order.chunk_by(|&a, &b| p[a] == p[b]) {
        let mean = start as f64 + (equal.len() as f64 + 1.0) / 2.0;
        let own = equal.iter().filter(|&&row| codes[row] == class).count();
        ranks += mean * own as f64;
        start += equal.len();
    }
    let own = codes.iter().filter(|&&code| code == class).count() as f64;
    let others = codes.len() as f64 - own;
    let pairs = own * others;
    (pairs > 0.0).then(|| (ranks - own * (own + 1.0) / 2.0) / pairs)
}

/// The expected calibration error (Naeini, Cooper and Hauskrecht, 2015): rows are put into `bins` equal bins
/// by the probability of their most probable class; the mean over rows of the difference, in their bin,
/// between that probability and the share that is right.
///
/// # Errors
/// Those of [`log_loss`]; [`Error::Parameter`] for no bins.
pub fn calibration_error<A: Scalar, L: PartialEq>(
    probabilities: &ArrayRef2<A>,
    truth: &[L],
    classes: &[L],
    bins: usize,
) -> Result<f64> {
    let codes = check_probabilities(probabilities, truth, classes)?;
    if bins == 0 {
        return Err(Error::Parameter {
            name: "bins",
            value: 0.0,
            expected: "at least 1",
        });
    }
    let mut excess = vec![0.0; bins];
    for (p, &code) in probabilities.rows().into_iter().zip(&codes) {
        let better = |best: usize, class: usize| if p[class] > p[best] { class } else { best };
        let best = (0..p.len()).fold(0, better);
        let sure = p[best].as_f64().clamp(0.0, 1.0);
        let bin = ((sure * bins as f64) as usize).min(bins - 1);
        excess[bin] += sure - f64::from(u8::from(best == code));
    }
    Ok(excess.iter().map(|e| e.abs()).sum::<f64>() / codes.len() as f64)
}

fn check_labels(predicted: usize, truth: usize) -> Result<()> {
    check_length("predicted labels", predicted, truth)?;
    if truth == 0 {
        return Err(Error::Empty {
            what: "truth",
            rows: 0,
            columns: 1,
        });
    }
    Ok(())
}

fn code<L: PartialEq>(classes: &[L], label: &L, row: usize) -> Result<usize> {
    let found = classes.iter().position(|class| class == label);
    found.ok_or(Error::UnknownClass { row })
}

/// The class of each row.
fn check_probabilities<A: Scalar, L: PartialEq>(
    probabilities: &ArrayRef2<A>,
    truth: &[L],
    classes: &[L],
) -> Result<Vec<usize>> {
    check_length("rows of probabilities", probabilities.nrows(), truth.len())?;
    check_length(
        "columns of probabilities",
        probabilities.ncols(),
        classes.len(),
    )?;
    check_some("probabilities", probabilities.view())?;
    check_finite("probabilities", probabilities.view())?;
    let labels = truth.iter().enumerate();
    labels
        .map(|(row, label)| code(classes, label, row))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    /// Counted by hand, and over all pairs.
    #[test]
    fn areas_and_scores_of_a_hand_computed_case() {
        let p = array![[0.9, 0.1], [0.6, 0.4], [0.6, 0.4], [0.2, 0.8]];
        let truth = ["a", "a", "b", "b"];
        // Pairs of a and b: 0.9 over 0.6 and 0.2, 0.6 equal to 0.6 and over 0.2: 3.5 of 4.
        assert_eq!(roc_auc(&p, &truth, &["a", "b"]).unwrap(), Some(3.5 / 4.0));
        // 0.02 + 0.32 + 0.72 + 0.08.
        let brier = brier_score(&p, &truth, &["a", "b"]).unwrap();
        approx::assert_relative_eq!(brier, 1.14 / 4.0, max_relative = 1e-14);
        // One bin: mean confidence 0.725, right 0.75.
        let error = calibration_error(&p, &truth, &["a", "b"], 1).unwrap();
        approx::assert_relative_eq!(error, 0.025, max_relative = 1e-12);
        assert_eq!(roc_auc(&p, &["a"; 4], &["a", "b"]).unwrap(), None);
    }

    #[test]
    fn labels_that_are_no_class_are_named() {
        let p = array![[0.5, 0.5], [0.5, 0.5]];
        let unknown = Err(Error::UnknownClass { row: 1 });
        assert_eq!(log_loss(&p, &["a", "c"], &["a", "b"]), unknown);
        assert!(accuracy::<&str>(&[], &[]).is_err());
    }
}
