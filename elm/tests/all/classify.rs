//! Classifiers: calibration by leave-one-out against refits, weights, files, pieces, errors.

use elm::classify::{ClassAccumulator, ClassWeights, LabeledRows};
use elm::metrics::{accuracy, calibration_error, log_loss};
use elm::persist::{self, from_bytes, to_bytes};
use elm::prune::Keep;
use elm::solve::Ridge;
use elm::{ElmClassifier, ElmParams, Error};
use ndarray::{Array1, Array2, Axis, array};

/// Three overlapping clouds: the label of each row is drawn, so that the best accuracy is about 0.85.
fn clouds(rows: usize, seed: u64) -> (Array2<f64>, Vec<&'static str>) {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / 2_f64.powi(53)
    };
    let mut x = Array2::zeros((rows, 2));
    let mut labels = Vec::new();
    for mut row in x.rows_mut() {
        let class = (3.0 * uniform()) as usize;
        let center = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.8]][class];
        for (value, center) in row.iter_mut().zip(center) {
            let normal: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            *value = center + 0.7 * normal;
        }
        labels.push(["red", "green", "blue"][class]);
    }
    (x, labels)
}

fn classes_of(model: &ElmClassifier<f64, &'static str>) -> Vec<&'static str> {
    model.classes().to_vec()
}

#[test]
fn probabilities_are_calibrated_and_sum_to_one() {
    let (x, labels) = clouds(600, 1);
    let (new, truth) = clouds(4000, 2);
    let model = ElmParams::new(60).fit_classifier(&x, &labels).unwrap();
    assert_eq!(model.classes(), ["blue", "green", "red"]);
    let p = model.predict_proba(&new).unwrap();
    for row in p.rows() {
        assert!(row.iter().all(|p| (0.0..=1.0).contains(p)));
        assert!((row.sum() - 1.0).abs() < 1e-12);
    }
    let classes = classes_of(&model);
    assert!(accuracy(&model.predict(&new).unwrap(), &truth).unwrap() > 0.8);
    assert!(log_loss(&p, &truth, &classes).unwrap() < 0.55);
    // Bins of 4000 rows have a standard error of about 0.01.
    assert!(calibration_error(&p, &truth, &classes, 10).unwrap() < 0.04);
    // Far outside and in f32 as well.
    let far = model.predict_proba(&array![[1e300, -1e300]]).unwrap();
    assert!((far.sum() - 1.0).abs() < 1e-12);
    let single = ElmParams::new(60)
        .fit_classifier(&x.mapv(|v| v as f32), &labels)
        .unwrap();
    let p32 = single.predict_proba(&new.mapv(|v| v as f32)).unwrap();
    assert!((p32.mapv(f64::from) - &p).iter().all(|d| d.abs() < 0.02));
}

/// The slope is that of scores by networks that have not seen the row: here each is fitted.
#[test]
fn the_calibration_is_that_of_refits_without_each_row() {
    let (x, labels) = clouds(40, 3);
    let binary: Vec<bool> = labels.iter().map(|&label| label == "red").collect();
    let lambda = 1e-3;
    let params = ElmParams::new(8)
        .with_standardize(false)
        .with_solver(Ridge::relative(lambda));
    let model = params.fit_classifier(&x, &binary).unwrap();
    // The ridge of the refits is that of all rows: in units of their own largest singular value.
    let largest = |x: &Array2<f64>| {
        let map = params.feature_map().draw_on(&x.view()).unwrap();
        let h = map.transform(x).unwrap();
        let centered = &h - &h.mean_axis(Axis(0)).unwrap();
        let products = centered.t().dot(&centered);
        let mut v = Array1::from_elem(8, 1.0);
        for _ in 0..2000 {
            v = products.dot(&v);
            v /= v.dot(&v).sqrt();
        }
        v.dot(&products.dot(&v))
    };
    let all = largest(&x);
    let (mut scores, mut codes) = (Vec::new(), Vec::new());
    for row in 0..40 {
        let others: Vec<usize> = (0..40).filter(|other| *other != row).collect();
        let rest = x.select(Axis(0), &others);
        let t: Vec<f64> = others
            .iter()
            .map(|&r| f64::from(u8::from(binary[r])))
            .collect();
        let own = params.clone().with_bounded(false);
        let own = own.with_solver(Ridge::relative(lambda * all / largest(&rest)));
        let without = own.fit(&rest, &t).unwrap();
        let score = without.predict(&x.select(Axis(0), &[row])).unwrap()[0];
        scores.push(score.clamp(-0.25, 1.25));
        codes.push(binary[row]);
    }
    // At the least of the smoothed log loss both derivatives vanish.
    let (slope, shifts) = (model.calibration().slope(), model.calibration().shifts());
    let share = 1.0 / 42.0;
    let rest: Vec<f64> = scores
        .iter()
        .zip(&codes)
        .map(|(f, &second)| {
            let z = slope * (2.0 * f - 1.0) + shifts[1] - shifts[0];
            1.0 / (1.0 + (-z).exp()) - if second { 1.0 - share } else { share }
        })
        .collect();
    let by_shift = rest.iter().sum::<f64>() / 40.0;
    let by_slope = rest.iter().zip(&scores).map(|(r, f)| r * f).sum::<f64>() / 40.0;
    assert!(
        by_shift.abs() < 1e-6 && by_slope.abs() < 1e-6,
        "{by_shift} {by_slope}"
    );
}

#[test]
fn a_weight_of_two_is_two_rows() {
    let (x, labels) = clouds(90, 4);
    let weights: Array1<f64> = (0..90).map(|row| (row % 3) as f64).collect();
    let rows: Vec<usize> = (0..90).flat_map(|row| vec![row; row % 3]).collect();
    let repeated = x.select(Axis(0), &rows);
    let twice: Vec<&str> = rows.iter().map(|&row| labels[row]).collect();
    let params = ElmParams::new(20).with_solver(Ridge::relative(1e-4));
    let data = LabeledRows::new(&x, &labels)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    let weighted = params.fit_labeled(&data).unwrap();
    let all = params.fit_classifier(&repeated, &twice).unwrap();
    let difference = weighted.predict_proba(&x).unwrap() - all.predict_proba(&x).unwrap();
    assert!(difference.iter().all(|d| d.abs() < 1e-6), "{difference}");
}

#[test]
fn balanced_classes_count_for_the_same() {
    let (x, mut labels) = clouds(400, 5);
    // Most rows of one class.
    let rows: Vec<usize> = (0..400)
        .filter(|row| labels[*row] == "red" || row % 5 == 0)
        .collect();
    labels = rows.iter().map(|&row| labels[row]).collect();
    let x = x.select(Axis(0), &rows);
    let params = ElmParams::new(30);
    let data = LabeledRows::new(&x, &labels).unwrap();
    let plain = params.fit_labeled(&data).unwrap();
    let balanced = data.with_class_weights(ClassWeights::Balanced).unwrap();
    let balanced = params.fit_labeled(&balanced).unwrap();
    let (new, truth) = clouds(2000, 6);
    let recall = |model: &ElmClassifier<f64, &str>| {
        elm::metrics::balanced_accuracy(&model.predict(&new).unwrap(), &truth).unwrap()
    };
    assert!(recall(&balanced) > recall(&plain));
}

#[test]
fn pieces_in_any_order_give_what_a_batch_gives_and_may_lack_classes() {
    let (x, labels) = clouds(900, 7);
    let params = ElmParams::new(30).with_solver(Ridge::relative(1e-5));
    let all = ["red", "green", "blue"];
    let mut rows = ClassAccumulator::from_sample(&params, &x, &all).unwrap();
    let mut order: Vec<usize> = (0..900).collect();
    order.sort_by_key(|&row| labels[row]);
    for piece in order.chunks(150) {
        let own: Vec<&str> = piece.iter().map(|&row| labels[row]).collect();
        rows.push(&x.select(Axis(0), piece), &own).unwrap();
        if piece[0] == order[0] {
            assert_eq!(rows.fit().unwrap_err(), Error::OneClass);
        }
    }
    let pieces = rows.fit().unwrap();
    let batch = params.fit_classifier(&x, &labels).unwrap();
    let difference = pieces.predict_proba(&x).unwrap() - batch.predict_proba(&x).unwrap();
    assert!(difference.iter().all(|d| d.abs() < 1e-6));
    let unknown = rows.push(&x.select(Axis(0), &[0]), &["pink"]);
    assert_eq!(unknown, Err(Error::UnknownClass { row: 0 }));
    let mut other = ClassAccumulator::from_sample(&params, &x, &all).unwrap();
    rows.compact().unwrap();
    assert_eq!(rows.fit().unwrap(), pieces);
    other.merge(&rows).unwrap();
    assert!(
        (other.fit().unwrap().calibration().slope() - pieces.calibration().slope()).abs() < 1e-6
    );
}

#[test]
fn classes_that_move_are_followed() {
    let (x, labels) = clouds(300, 9);
    let before: Vec<&str> = labels.iter().rev().copied().collect();
    let params = ElmParams::new(20).with_solver(Ridge::relative(1e-6));
    let new = ClassAccumulator::from_sample(&params, &x, &["blue", "green", "red"]).unwrap();
    let mut only = new.clone();
    only.push(&x, &labels).unwrap();
    for factor in [0.0, 1e-300] {
        let mut rows = new.clone();
        rows.push(&x, &before).unwrap();
        rows.forget(factor).unwrap();
        if factor == 0.0 {
            assert!(rows.fit().is_err());
        }
        rows.push(&x, &labels).unwrap();
        let (rows, only) = (rows.fit().unwrap(), only.fit().unwrap());
        let difference = rows.predict_proba(&x).unwrap() - only.predict_proba(&x).unwrap();
        assert!(difference.iter().all(|d| d.abs() < 1e-6));
    }
    assert!(new.clone().forget(1.5).is_err());
}

#[test]
fn files_give_back_the_same_bits_and_damage_is_an_error() {
    let (x, labels) = clouds(200, 8);
    let labels: Vec<String> = labels.iter().map(|&label| label.to_owned()).collect();
    let model = ElmParams::new(20).fit_classifier(&x, &labels).unwrap();
    let bytes = to_bytes(&model).unwrap();
    let again: ElmClassifier<f64, String> = from_bytes(&bytes).unwrap();
    assert_eq!(again, model);
    let text = persist::to_json(&model).unwrap();
    let again: ElmClassifier<f64, String> = from_bytes(text.as_bytes()).unwrap();
    assert_eq!(
        again.predict_proba(&x).unwrap(),
        model.predict_proba(&x).unwrap()
    );
    for end in (0..bytes.len()).step_by(97) {
        assert!(from_bytes::<ElmClassifier<f64, String>>(&bytes[..end]).is_err());
    }
    let unsorted = text.replace("\"blue\",\n", "\"zebra\",\n");
    assert!(from_bytes::<ElmClassifier<f64, String>>(unsorted.as_bytes()).is_err());
    let params = ElmParams::new(20);
    let mut rows = ClassAccumulator::from_sample(&params, &x, &labels).unwrap();
    rows.push(&x, &labels).unwrap();
    let bytes = to_bytes(&rows).unwrap();
    let again: ClassAccumulator<f64, String> = from_bytes(&bytes).unwrap();
    assert_eq!(again, rows);
}

#[test]
fn pruned_and_tuned_classifiers_are_good_ones() {
    let (x, labels) = clouds(300, 9);
    let (new, truth) = clouds(2000, 10);
    let data = LabeledRows::new(&x, &labels).unwrap();
    let pruned = ElmParams::new(100)
        .fit_pruned_classifier(&data, Keep::Neurons(15))
        .unwrap();
    assert_eq!(pruned.classifier.model().hidden().neurons(), 15);
    assert!(pruned.classifier.score(&new, &truth).unwrap() > 0.8);
    let tuned = ElmParams::auto().fit_classifier(&x, &labels).unwrap();
    assert!(tuned.score(&new, &truth).unwrap() > 0.82);
}

#[test]
fn what_is_no_classification_is_a_typed_error() {
    let x = array![[0.0], [1.0], [2.0]];
    let params = ElmParams::new(5);
    assert_eq!(params.fit_classifier(&x, &[1, 1, 1]), Err(Error::OneClass));
    assert!(matches!(
        params.fit_classifier(&x, &[1, 2]),
        Err(Error::Shape { .. })
    ));
    let weights = array![1.0, 1.0, 0.0];
    let rows = LabeledRows::new(&x, &[1, 1, 2])
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    assert_eq!(params.fit_labeled(&rows), Err(Error::OneClass));
    let none: Array2<f64> = Array2::zeros((0, 1));
    assert!(matches!(
        params.fit_classifier::<_, i32>(&none, &[]),
        Err(Error::Empty { .. })
    ));
    // Two rows, one of each class.
    let two = params
        .fit_classifier(&array![[0.0], [1.0]], &["a", "b"])
        .unwrap();
    assert!(two.predict_proba(&x).unwrap().iter().all(|p| p.is_finite()));
    // Pure noise gives no probability that noise does not have.
    let (x, labels) = clouds(200, 11);
    let shuffled: Vec<&str> = (0..200).map(|row| labels[(row * 77 + 13) % 200]).collect();
    let model = params.fit_classifier(&x, &shuffled).unwrap();
    let p = model.predict_proba(&clouds(500, 12).0).unwrap();
    assert!(p.iter().all(|&p| p < 0.75), "{p}");
}
