//! Ramps beside the inputs: in fits, files, predictors, accumulators, pruning and uncertainty.

use elm::advanced::FeatureMap;
use elm::prune::Keep;
use elm::solve::Ridge;
use elm::{
    Accumulator, Activation, Biases, Dataset, Elm, ElmParams, Embedding, Error, NeuronGroup, Ramps,
    persist,
};
use ndarray::{Array1, Array2, Axis, Ix1, array, s};

use crate::common::normal;

/// A skewed input, a column of 0 and 1, one of three values, and a constant.
fn rows(count: usize, seed: u64) -> (Array2<f64>, Array1<f64>) {
    let z = normal::<f64>(count, 3, seed);
    let x = Array2::from_shape_fn((count, 4), |(i, j)| match j {
        0 => z[[i, 0]].exp(),
        1 => f64::from(z[[i, 1]] > 0.3),
        2 => (z[[i, 2]] + 0.5).round().clamp(-1.0, 1.0),
        _ => 7.0,
    });
    let t = x.map_axis(Axis(1), |row| row[0].ln().sin() + row[1] * row[2]);
    (x, t)
}

fn settings() -> ElmParams<f64> {
    ElmParams::new(40)
        .with_activation(Activation::Tanh)
        .with_biases(Biases::AtTrainingRows)
        .with_embedding(Embedding::Quantiles(8))
        .with_seed(3)
}

/// Every kind of network with ramps.
fn kinds() -> Vec<ElmParams<f64>> {
    vec![
        settings(),
        settings().with_direct_links(true),
        settings().with_standardize(false).with_direct_links(true),
        settings().with_group(NeuronGroup::rbf(9)),
        settings().with_group(NeuronGroup::new(9, Activation::Sine)),
        settings().with_bounded(false).with_direct_links(true),
    ]
}

#[test]
fn a_prediction_is_the_features_times_the_output_weights() {
    let (x, t) = rows(150, 1);
    let both = ndarray::stack![Axis(1), t, t.mapv(|t| t * t)];
    // Far outside, at the edges and inside.
    let mut other = rows(37, 2).0;
    other[[0, 0]] = 1e6;
    other[[1, 0]] = -1e6;
    other.row_mut(2).assign(&x.row(5));
    for params in kinds() {
        let model = params.fit(&x, &both).unwrap().with_bounded(false);
        let expected = model.hidden_matrix(&other).unwrap().dot(&model.beta()) + model.intercept();
        let predicted = model.predict(&other).unwrap();
        approx::assert_relative_eq!(predicted, expected, max_relative = 1e-8, epsilon = 1e-8);
        // A row alone has the same bits as among others.
        let predictor = model.predictor();
        let mut scratch = predictor.scratch();
        let mut one = [0.0; 2];
        for (row, expected) in other.rows().into_iter().zip(predicted.rows()) {
            predictor
                .predict_row(&row.to_vec(), &mut one, &mut scratch)
                .unwrap();
            assert_eq!(one.to_vec(), expected.to_vec());
        }
    }
}

#[test]
fn single_precision_predicts_what_double_does() {
    let (x, t) = rows(150, 1);
    let single = (x.mapv(|v| v as f32), t.mapv(|v| v as f32));
    let params = ElmParams::<f32>::new(30)
        .with_embedding(Embedding::Quantiles(8))
        .with_direct_links(true)
        .with_solver(Ridge::relative(1e-4));
    let model = params.fit(&single.0, &single.1).unwrap();
    let expected = model.hidden_matrix(&single.0).unwrap().dot(&model.beta()) + model.intercept();
    let predicted = model.predict(&single.0).unwrap();
    approx::assert_abs_diff_eq!(predicted, expected.column(0).to_owned(), epsilon = 1e-3);
}

#[test]
fn a_fit_is_one_to_the_rows_that_its_ramps_were_laid_on() {
    let (x, t) = rows(120, 1);
    let ramps = Ramps::quantiles(&x, 8).unwrap();
    let given = settings().with_embedding(Embedding::Ramps(ramps.clone()));
    let model = given.fit(&x, &t).unwrap();
    assert_eq!(model, settings().fit(&x, &t).unwrap());
    assert_eq!(model.map().ramps(), Some(&ramps));
    assert_eq!(model.inputs(), 4);
    // One scale for each input is one for its ramps, too.
    let mut scales = vec![1.0; 4 + ramps.columns()];
    let ramps_of_first = ramps.edges(0).len() - 1;
    scales[0] = 0.5;
    scales[4..4 + ramps_of_first].fill(0.5);
    let by_column = settings().with_input_scales(scales).fit(&x, &t).unwrap();
    let by_input = settings().with_input_scales(vec![0.5, 1.0, 1.0, 1.0]);
    assert_eq!(by_column, by_input.fit(&x, &t).unwrap());
    for wrong in [vec![1.0; 5], vec![1.0; 3]] {
        let refused = settings().with_input_scales(wrong).fit(&x, &t);
        assert!(matches!(refused, Err(Error::Shape { .. })));
    }
    let refused = settings()
        .with_embedding(Embedding::Quantiles(0))
        .fit(&x, &t);
    assert!(matches!(
        refused,
        Err(Error::Parameter { name: "ramps", .. })
    ));
    let narrow = x.slice(s![.., ..3]).to_owned();
    assert!(given.fit(&narrow, &t).is_err());
}

#[test]
fn files_keep_ramps() {
    let (x, t) = rows(120, 1);
    for params in kinds() {
        let model = params.fit(&x, &t).unwrap();
        let binary: Elm<f64, Ix1> =
            persist::from_bytes(&persist::to_bytes(&model).unwrap()).unwrap();
        assert_eq!(binary, model);
        let text = persist::to_json(&model).unwrap();
        let json: Elm<f64, Ix1> = persist::from_bytes(text.as_bytes()).unwrap();
        assert_eq!(json, model);
        let settings = serde_json::to_string(&params).unwrap();
        assert_eq!(params, serde_json::from_str(&settings).unwrap());
    }
    let text = persist::to_json(&settings().fit(&x, &t).unwrap()).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["contents"]["map"]["ramps"]["edges"][1] = serde_json::json!([0.0, 1.0]);
    let refused = persist::from_bytes::<Elm<f64, Ix1>>(value.to_string().as_bytes());
    assert!(refused.is_err(), "more ramps than the layer has inputs");
    value["contents"]["map"]["ramps"]["edges"][0] = serde_json::json!([1.0, 0.0]);
    assert!(persist::from_bytes::<Elm<f64, Ix1>>(value.to_string().as_bytes()).is_err());
}

#[test]
fn an_accumulator_lays_ramps_on_its_sample() {
    let (x, t) = rows(200, 1);
    let params = settings()
        .with_direct_links(true)
        .with_solver(Ridge::relative(1e-6));
    let mut pieces = Accumulator::from_sample(&params, &x, 1).unwrap();
    let mut other = pieces.clone();
    pieces
        .push(&x.slice(s![..90, ..]), &t.slice(s![..90]))
        .unwrap();
    other
        .push(&x.slice(s![90.., ..]), &t.slice(s![90..]))
        .unwrap();
    pieces.merge(&other).unwrap();
    let model: Elm<f64, Ix1> = pieces.fit().unwrap();
    let whole = params.fit(&x, &t).unwrap();
    assert_eq!(model.map(), whole.map());
    approx::assert_abs_diff_eq!(
        model.predict(&x).unwrap(),
        whole.predict(&x).unwrap(),
        epsilon = 1e-6
    );
    let bytes = persist::to_bytes(&pieces).unwrap();
    assert_eq!(pieces, persist::from_bytes(&bytes).unwrap());
    // Other edges do not go together.
    let fewer = x.slice(s![..50, ..]).to_owned();
    let unlike: Accumulator<f64, Ix1> = Accumulator::from_sample(&params, &fewer, 1).unwrap();
    assert!(pieces.merge(&unlike).is_err());
    let scaler = elm::Scaler::measured(&x).unwrap();
    let plain = ElmParams::new(5).with_embedding(Embedding::Quantiles(4));
    let refused = Accumulator::<f64, Ix1>::with_scaler(&plain, scaler, 1);
    assert!(matches!(refused, Err(Error::Conflict { .. })));
}

#[test]
fn pruned_and_joined_networks_keep_their_ramps() {
    let (x, t) = rows(150, 1);
    let data = Dataset::new(&x, &t).unwrap();
    let pruned = settings().fit_pruned(&data, Keep::Neurons(12)).unwrap();
    assert!(pruned.model.map().ramps().is_some());
    assert_eq!(pruned.model.hidden().neurons(), 12);
    let mean = settings().fit_ensemble(3, &data).unwrap();
    let members: Array1<f64> = mean
        .members()
        .map(|member| member.predict(&x).unwrap())
        .fold(Array1::zeros(150), |sum, own| sum + own / 3.0);
    approx::assert_abs_diff_eq!(mean.model().predict(&x).unwrap(), members, epsilon = 1e-9);
    let (low, high) = mean.predict_interval(&x, 0.9).unwrap();
    assert!(low.iter().zip(&high).all(|(low, high)| low < high));
}

#[test]
fn outside_the_data_only_the_held_input_counts() {
    let (x, t) = rows(150, 1);
    let model = settings().with_direct_links(true).fit(&x, &t).unwrap();
    let predict = |far: f64| model.predict(&array![[far, 1.0, 0.0, 7.0]]).unwrap()[0];
    assert_eq!(predict(1e6), predict(1e12));
    assert_eq!(predict(-1e6), predict(-1e12));
    let (least, greatest) = model.bounds().unwrap().predictions();
    for far in [-1e6, 1e6] {
        assert!((least[0]..=greatest[0]).contains(&predict(far)));
    }
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let (x, _) = rows(60, 1);
    let ramps = Ramps::quantiles(&x, 4).unwrap();
    let layer = ElmParams::<f64>::new(5).feature_map().draw(4).unwrap();
    let refused = FeatureMap::with_ramps(None, ramps.clone(), layer, false);
    assert!(matches!(refused, Err(Error::Shape { .. })));
    let params = ElmParams::<f64>::new(5).with_embedding(Embedding::Ramps(ramps.clone()));
    let layer = params.feature_map().draw(4).unwrap();
    let map = FeatureMap::with_ramps(None, ramps, layer, true).unwrap();
    assert_eq!(map.transform(&x).unwrap().dim(), (60, map.features()));
}
