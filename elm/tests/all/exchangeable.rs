//! Choices where rows are not alike: they differ in noise, are copies of each other, or follow in time.

use elm::classify::LabeledRows;
use elm::cross_validation::{assign_blocks, assign_folds};
use elm::solve::Ridge;
use elm::tune::Criterion;
use elm::{Dataset, ElmParams, Error};
use ndarray::{Array1, Array2, Axis};

use crate::common::normal;

fn truth(x: &Array2<f64>) -> Array1<f64> {
    x.map_axis(Axis(1), |row| (2.0 * row[0]).sin() + row[0] * row[1])
}

/// Half of the rows have noise of deviation 0.01, the others 60 times as much.
fn uneven(rows: usize, seed: u64) -> (Array2<f64>, Array1<f64>, Array1<f64>) {
    let z = normal::<f64>(rows, 3, seed);
    let x = z.slice(ndarray::s![.., ..2]).to_owned();
    let deviation = Array1::from_shape_fn(rows, |i| if i % 2 == 0 { 0.01 } else { 0.6 });
    let t = truth(&x) + &z.column(2) * &deviation;
    (x, t, deviation.mapv(|d| d.powi(-2)))
}

/// Groups of ten rows that are nearly copies, each with an effect of its own.
fn copies(groups: usize, seed: u64) -> (Array2<f64>, Array1<f64>, Vec<usize>) {
    let (centers, effects) = (
        normal::<f64>(groups, 3, seed),
        normal::<f64>(groups, 1, seed + 1),
    );
    let noise = normal::<f64>(10 * groups, 4, seed + 2);
    let x = Array2::from_shape_fn((10 * groups, 3), |(i, j)| {
        centers[[i / 10, j]] + 0.01 * noise[[i, j]]
    });
    let t = Array1::from_shape_fn(10 * groups, |i| {
        let group = i / 10;
        0.3 * centers[[group, 0]].sin() + 0.8 * effects[[group, 0]] + 0.04 * noise[[i, 3]]
    });
    (x, t, (0..10 * groups).map(|i| i / 10).collect())
}

fn error(model: &elm::Elm<f64, ndarray::Ix1>, x: &Array2<f64>, t: &Array1<f64>) -> f64 {
    elm::metrics::rmse(&model.predict(x).unwrap(), t).unwrap()
}

#[test]
fn the_search_counts_rows_by_their_weights() {
    let (x, t, weights) = uneven(400, 1);
    let other = normal::<f64>(1000, 2, 9).mapv(|x| x.clamp(-1.8, 1.8));
    let exact = truth(&other);
    let data = Dataset::new(&x, &t).unwrap();
    let blind = ElmParams::auto().tune(&data).unwrap().model;
    let weighted = data.with_weights(&weights).unwrap();
    for tuner in [ElmParams::auto(), ElmParams::auto().quick()] {
        let tuned = tuner.tune(&weighted).unwrap();
        let (with, without) = (
            error(&tuned.model, &other, &exact),
            error(&blind, &other, &exact),
        );
        assert!(with < 0.3 * without, "{with} {without}");
        // What the settings give that a search of the precise rows alone would choose.
        let precise: Vec<usize> = (0..400).step_by(2).collect();
        let alone = (x.select(Axis(0), &precise), t.select(Axis(0), &precise));
        let alone = tuner.fit(&alone.0, &alone.1).unwrap();
        assert!(with < 1.5 * error(&alone, &other, &exact), "{with}");
    }
}

#[test]
fn the_search_holds_groups_out_together() {
    let (x, t, groups) = copies(30, 1);
    let (other, unseen, _) = copies(100, 77);
    let data = Dataset::new(&x, &t).unwrap();
    let blind = ElmParams::auto().tune(&data).unwrap();
    let promised = |score: f64| score * t.std(0.0);
    assert!(promised(blind.best.score) < 0.2 * error(&blind.model, &other, &unseen));
    let grouped = data.with_groups(&groups).unwrap();
    for criterion in [Criterion::LeaveOneOut, Criterion::KFold(5)] {
        let tuned = ElmParams::auto()
            .with_criterion(criterion)
            .tune(&grouped)
            .unwrap();
        let delivered = error(&tuned.model, &other, &unseen);
        let ratio = delivered / promised(tuned.best.score);
        assert!((0.7..1.4).contains(&ratio), "{criterion:?}: {ratio}");
        let uncertain = tuned.params.fit_uncertain(&grouped).unwrap();
        let (low, high) = uncertain.predict_interval(&other, 0.9).unwrap();
        let inside = |((t, low), high): ((&f64, &f64), &f64)| low <= t && t <= high;
        let covered = unseen
            .iter()
            .zip(&low)
            .zip(&high)
            .filter(|&v| inside(v))
            .count();
        assert!(covered >= 800, "{covered} of 1000");
    }
}

#[test]
fn ridge_takes_its_strength_from_the_folds_that_judge_it() {
    let (x, t, groups) = copies(30, 1);
    let data = Dataset::new(&x, &t).unwrap();
    let params = ElmParams::<f64>::new(100);
    let held_out = params.cross_val_predict(&data, &groups).unwrap().rmse();
    // Every strength by itself.
    let best = (-24..4)
        .map(|step| {
            let ridge = Ridge::relative(10.0_f64.powf(f64::from(step) / 2.0));
            let params = params.clone().with_solver(ridge);
            params.cross_val_predict(&data, &groups).unwrap().rmse()
        })
        .fold(f64::INFINITY, f64::min);
    assert!(held_out < 1.01 * best, "{held_out} {best}");
    // A fit to rows with groups has that strength, too.
    let lambda = |data: &Dataset<'_, f64, ndarray::Ix1>| {
        params.fit_dataset(data).unwrap().diagnosis().lambda[0]
    };
    assert!(lambda(&data.with_groups(&groups).unwrap()) > 10.0 * lambda(&data));
}

#[test]
fn blocks_are_neighbours_in_time() {
    assert_eq!(assign_blocks(7, 3).unwrap(), [0, 0, 0, 1, 1, 2, 2]);
    assert!(assign_blocks(3, 1).is_err() && assign_blocks(3, 4).is_err());
    // A random walk: each row is nearly the one before.
    let steps = normal::<f64>(400, 1, 5);
    let mut sum = 0.0;
    let t = steps.column(0).mapv(|step| {
        sum += step;
        sum
    });
    let x = Array1::linspace(0.0, 1.0, 400).insert_axis(Axis(1));
    let data = Dataset::new(&x, &t).unwrap();
    let score = |criterion| {
        let tuner = ElmParams::auto().with_criterion(criterion);
        tuner.tune(&data).unwrap().best.score
    };
    assert!(score(Criterion::Blocks(8)) > 2.0 * score(Criterion::KFold(8)));
}

#[test]
fn one_label_for_all_rows_is_named() {
    let (x, t, _) = copies(6, 1);
    let same = vec![4; 60];
    let data = Dataset::new(&x, &t).unwrap();
    let params = ElmParams::<f64>::new(10);
    let named = |error: Error| {
        let text = error.to_string();
        let named = text.contains("fold labels") || text.contains("groups");
        assert!(named && text.contains("at least 2 different"), "{text}");
    };
    named(params.cross_val_predict(&data, &same).unwrap_err());
    named(params.fold_predictions(&data, &same).unwrap_err());
    let grouped = data.with_groups(&same).unwrap();
    named(ElmParams::auto().tune(&grouped).unwrap_err());
    named(params.fit_dataset(&grouped).unwrap_err());
    named(params.fit_uncertain(&grouped).unwrap_err());
}

/// Rows with weights 0, 1 and 2, and the same with the rows omitted and repeated.
fn counted(seed: u64) -> [(Array2<f64>, Array1<f64>, Array1<f64>); 2] {
    let x = normal::<f64>(150, 2, seed);
    let t = truth(&x) + 0.2 * normal::<f64>(150, 1, seed + 1).column(0).to_owned();
    let counts: Vec<usize> = (0..150).map(|i| [1, 2, 0, 2, 1][i % 5]).collect();
    let repeated: Vec<usize> = (0..150)
        .flat_map(|row| std::iter::repeat_n(row, counts[row]))
        .collect();
    let weights = counts.iter().map(|&count| count as f64).collect();
    let again = (
        x.select(Axis(0), &repeated),
        t.select(Axis(0), &repeated),
        Array1::ones(repeated.len()),
    );
    [(x, t, weights), again]
}

#[test]
fn a_row_of_weight_two_is_the_row_twice_where_the_strength_is_chosen() {
    for seed in 0..4 {
        let [(x, t, weights), (twice_x, twice_t, _)] = counted(seed);
        let other = normal::<f64>(200, 2, seed + 50);
        let params = ElmParams::<f64>::new(60);
        let data = Dataset::new(&x, &t).unwrap();
        let weighted = params
            .fit_dataset(&data.with_weights(&weights).unwrap())
            .unwrap();
        let repeated = params.fit(&twice_x, &twice_t).unwrap();
        let difference = weighted.predict(&other).unwrap() - repeated.predict(&other).unwrap();
        let largest = difference.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        assert!(largest < 1e-6, "{seed}: {largest}");
    }
}

#[test]
fn a_factor_of_all_weights_and_rows_of_none_change_no_search_and_no_interval() {
    let [(x, t, weights), _] = counted(3);
    let present: Vec<usize> = (0..150).filter(|&row| weights[row] > 0.0).collect();
    let (few_x, few_t) = (x.select(Axis(0), &present), t.select(Axis(0), &present));
    let few = weights.select(Axis(0), &present) * 8.0;
    let all = Dataset::new(&x, &t)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    let omitted = Dataset::new(&few_x, &few_t)
        .unwrap()
        .with_weights(&few)
        .unwrap();
    let other = normal::<f64>(50, 2, 7);
    // Rows of weight 0 take part in the factorization as rows of zeros, which rounds differently; at the
    // weakest strength that is chosen here, about 1e-12, rounding of 1e-16 may grow to 1e-4.
    let close = |a: &Array1<f64>, b: &Array1<f64>| {
        approx::assert_relative_eq!(a, b, max_relative = 1e-4, epsilon = 1e-4);
    };
    for tuner in [ElmParams::auto(), ElmParams::auto().quick()] {
        let (one, same) = (tuner.tune(&all).unwrap(), tuner.tune(&omitted).unwrap());
        close(
            &one.model.predict(&other).unwrap(),
            &same.model.predict(&other).unwrap(),
        );
        let (one, same) = (
            one.params.fit_uncertain(&all).unwrap(),
            same.params.fit_uncertain(&omitted).unwrap(),
        );
        close(
            &one.predict_deviation(&other).unwrap(),
            &same.predict_deviation(&other).unwrap(),
        );
        let (ends, again) = (
            one.predict_interval(&other, 0.8).unwrap(),
            same.predict_interval(&other, 0.8).unwrap(),
        );
        close(&ends.0, &again.0);
        close(&ends.1, &again.1);
        approx::assert_relative_eq!(
            one.leave_one_out(),
            same.leave_one_out(),
            max_relative = 1e-4
        );
    }
}

#[test]
fn intervals_of_a_weighted_fit_leave_each_row_out_by_refitting() {
    let (x, t, weights) = uneven(40, 3);
    let params = ElmParams::<f64>::new(8).with_solver(Ridge::relative(1e-3));
    let data = Dataset::new(&x, &t)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    let model = params.fit_uncertain(&data).unwrap();
    let map = model.model().map().clone();
    let lambda = params.fit_dataset(&data).unwrap();
    let largest = lambda.diagnosis().largest_singular_value;
    let at = x.slice(ndarray::s![..1, ..]).to_owned();
    let (low, high) = model.predict_interval(&at, 0.5).unwrap();
    assert!(low[0] < high[0]);
    // The noise of a row of the mean weight, by hand from refits without each row.
    let mut errors = Vec::new();
    for left in 0..40 {
        let rest: Vec<usize> = (0..40).filter(|&row| row != left).collect();
        let (x_rest, t_rest) = (x.select(Axis(0), &rest), t.select(Axis(0), &rest));
        let w_rest = weights.select(Axis(0), &rest);
        let rest = Dataset::new(&x_rest, &t_rest)
            .unwrap()
            .with_weights(&w_rest)
            .unwrap();
        let probe = params.fit_map(map.clone(), &rest).unwrap();
        let own = probe.diagnosis().largest_singular_value;
        let ridge = Ridge::relative(1e-3 * (largest / own).powi(2));
        let fit = params
            .clone()
            .with_solver(ridge)
            .fit_map(map.clone(), &rest)
            .unwrap();
        let row = x.slice(ndarray::s![left..=left, ..]).to_owned();
        let unbounded = fit.with_bounded(false).predict(&row).unwrap()[0];
        errors.push((t[left] - unbounded).powi(2) * weights[left]);
    }
    let mean = weights.sum();
    let expected = (errors.iter().sum::<f64>() / mean).sqrt();
    approx::assert_relative_eq!(model.leave_one_out(), expected, max_relative = 1e-5);
}

#[test]
fn folds_as_labels_are_groups() {
    let (x, t, groups) = copies(12, 2);
    let labels = assign_folds(120, 4, 0).unwrap();
    let data = Dataset::new(&x, &t).unwrap();
    let one = ElmParams::auto()
        .tune(&data.with_groups(&labels).unwrap())
        .unwrap();
    let other = ElmParams::auto()
        .tune(&data.with_groups(&groups).unwrap())
        .unwrap();
    assert!(one.best.score < 0.5 * other.best.score);
}

/// Rows with weights 0 to 3, and the rows repeated.
fn repeated_rows() -> [(Array2<f64>, Vec<usize>, Array1<f64>); 2] {
    let x = normal::<f64>(90, 3, 11);
    let noise = normal::<f64>(90, 1, 12);
    let class = |i: usize| usize::from(x[[i, 0]] + x[[i, 1]] * x[[i, 2]] + noise[[i, 0]] > 0.0);
    let labels: Vec<usize> = (0..90).map(class).collect();
    let count = |i: usize| [1, 1, 2, 0, 3, 1][i % 6];
    let repeated: Vec<usize> = (0..90)
        .flat_map(|i| std::iter::repeat_n(i, count(i)))
        .collect();
    let again = repeated.iter().map(|&row| labels[row]).collect();
    let weights = (0..90).map(|i| count(i) as f64).collect();
    [
        (x.clone(), labels, weights),
        (x.select(Axis(0), &repeated), again, Array1::ones(0)),
    ]
}

#[test]
fn whole_weights_are_numbers_of_rows_in_searches_and_classifiers() {
    let [(x, labels, weights), (twice_x, twice_labels, _)] = repeated_rows();
    let other = normal::<f64>(50, 3, 13);
    let close = |what: &str, a: &Array2<f64>, b: &Array2<f64>| {
        let largest = (a - b).iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        assert!(largest <= 1e-7, "{what}: {largest}");
    };
    let target = |labels: &[usize]| -> Array2<f64> {
        let column: Array1<f64> = labels.iter().map(|&label| label as f64).collect();
        column.insert_axis(Axis(1))
    };
    let (t, twice_t) = (target(&labels), target(&twice_labels));
    let data = Dataset::new(&x, &t).unwrap();
    let data = data.with_weights(&weights).unwrap();
    let rows = LabeledRows::new(&x, &labels).unwrap();
    let rows = rows.with_weights(&weights).unwrap();
    for (what, tuner) in [
        ("quick", ElmParams::auto().quick()),
        ("full", ElmParams::auto()),
    ] {
        let weighted = tuner.tune(&data).unwrap().model;
        let repeated = tuner.fit(&twice_x, &twice_t).unwrap();
        let (weighted, repeated) = (weighted.predict(&other), repeated.predict(&other));
        close(what, &weighted.unwrap(), &repeated.unwrap());
        let weighted = tuner.tune_classifier(&rows).unwrap().classifier;
        let repeated = tuner.fit_classifier(&twice_x, &twice_labels).unwrap();
        let (weighted, repeated) = (
            weighted.predict_proba(&other),
            repeated.predict_proba(&other),
        );
        close(what, &weighted.unwrap(), &repeated.unwrap());
    }
    let params = ElmParams::new(50);
    let weighted = params.fit_labeled(&rows).unwrap();
    let repeated = params.fit_classifier(&twice_x, &twice_labels).unwrap();
    let (weighted, repeated) = (
        weighted.predict_proba(&other),
        repeated.predict_proba(&other),
    );
    close("a classifier", &weighted.unwrap(), &repeated.unwrap());
}
