//! Inputs that do not vary, hardly vary, or take two values; and scalers measured on the wrong rows.

use crate::common::normal;
use elm::advanced::FeatureMap;
use elm::solve::Ridge;
use elm::{Accumulator, Biases, Dataset, ElmParams, Error, Scalar, Scaler, ScalerBuilder, metrics};
use ndarray::{Array1, Array2, ArrayRef2, Axis, Ix1, array, s};

/// Evenly spread over [-1, 1) without a pattern.
fn spread(row: usize, step: f64) -> f64 {
    2.0 * (row as f64 * step).fract() - 1.0
}

/// The golden ratio and a number independent of it.
const STEPS: [f64; 2] = [0.618_033_988_749_895, 0.754_877_666_246_693];

fn rmse<A: Scalar>(model: &elm::Elm<A, Ix1>, x: &ArrayRef2<A>, t: &Array1<A>) -> f64 {
    let y = model.predict(x).unwrap();
    metrics::rmse(&y, t).unwrap()
}

#[test]
fn a_constant_input_is_ignored_whatever_the_number_of_rows() {
    for rows in [200, 1000, 3000] {
        let mut x = Array2::from_elem((rows, 2), 0.1);
        x.column_mut(0).assign(&Array1::from_shape_fn(rows, |row| {
            3.0 * spread(row, STEPS[0])
        }));
        let t = x.column(0).mapv(f64::sin);
        let at = array![[1.0, 0.1], [1.0, 0.1 + 1e-12], [1.0, 1e9]];
        for model in [
            ElmParams::new(50).fit(&x, &t).unwrap().with_bounded(false),
            ElmParams::auto().fit(&x, &t).unwrap().with_bounded(false),
        ] {
            assert_eq!(model.scaler().unwrap().factor()[1], 0.0);
            for y in model.predict(&at).unwrap() {
                approx::assert_abs_diff_eq!(y, 1.0_f64.sin(), epsilon = 1e-3);
            }
        }
    }
}

#[test]
fn constants_of_any_size_in_any_number_of_rows_have_no_factor() {
    for (value, rows) in [
        (0.1, 1000),
        (273.15, 200),
        (273.15, 1_000_000),
        (-1e-300, 77),
        (1e300, 77),
    ] {
        let scaler = Scaler::measured(&Array2::from_elem((rows, 1), value)).unwrap();
        assert_eq!((scaler.mean()[0], scaler.factor()[0]), (value, 0.0));
    }
    let scaler = Scaler::measured(&Array2::from_elem((1_000_000, 1), 273.15_f32)).unwrap();
    assert_eq!((scaler.mean()[0], scaler.factor()[0]), (273.15, 0.0));
}

#[test]
fn an_input_that_varies_little_beside_its_mean_is_seen_in_a_million_rows() {
    // The values are 1e6 and whole numbers of ten-millionths, of which doubles at 1e6 resolve
    // thousandths.
    let x = Array2::from_shape_fn((1_000_000, 1), |(row, _)| 1e6 + 1e-7 * (row % 10) as f64);
    let scaler = Scaler::measured(&x).unwrap();
    let deviation = 1e-7 * 8.25_f64.sqrt();
    approx::assert_relative_eq!(scaler.factor()[0], deviation.recip(), max_relative = 1e-3);
}

#[test]
fn single_precision_sees_what_double_precision_does_in_the_same_inputs() {
    // Sixteen values in [1e6, 1e6 + 1).
    let x = Array2::from_shape_fn((500, 1), |(row, _)| {
        1e6_f32 + spread(row, STEPS[0]).abs() as f32
    });
    let t = x.map_axis(Axis(1), |row| (6.0 * (row[0] - 1e6)).sin() * 7.0);
    let single = ElmParams::new(50).fit(&x, &t).unwrap();
    let (wide_x, wide_t) = (x.mapv(f64::from), t.mapv(f64::from));
    let double = ElmParams::new(50).fit(&wide_x, &wide_t).unwrap();
    let (single, double) = (rmse(&single, &x, &t), rmse(&double, &wide_x, &wide_t));
    assert!(single < 1.1 * double + 1e-2, "{single} {double}");
}

#[test]
fn a_million_rows_in_single_precision_are_fitted_as_in_double() {
    let rows = 200_000;
    let x = Array2::from_shape_fn((rows, 2), |(row, j)| 273.15 + spread(row, STEPS[j]));
    let t = x.map_axis(Axis(1), |row| 300.0 + ((row[0] - 273.15) * 3.0).sin());
    let params = ElmParams::new(20).with_solver(Ridge::relative(1e-4));
    let double = params.fit(&x, &t).unwrap();
    let narrow = |v: &f64| *v as f32;
    let params = ElmParams::new(20).with_solver(Ridge::relative(1e-4));
    let single = params.fit(&x.map(narrow), &t.map(narrow)).unwrap();
    let double = rmse(&double, &x, &t);
    let single = rmse(&single, &x.map(narrow), &t.map(narrow));
    assert!(single < 1.1 * double, "{single} {double}");
}

/// Rows of two inputs of which the network is to learn the product, the second one silent in the
/// first chunk.
fn chunk(number: usize, silent: impl Fn(usize) -> f64) -> (Array2<f64>, Array2<f64>) {
    let x = Array2::from_shape_fn((200, 2), |(row, j)| {
        if number == 0 && j == 1 {
            silent(row)
        } else {
            3.0 * spread(number * 200 + row + 1, STEPS[j])
        }
    });
    let t = x.map_axis(Axis(1), |row| row[0].sin() + 0.5 * row[1]);
    (x, t.insert_axis(Axis(1)))
}

#[test]
fn an_input_constant_in_the_sample_is_not_lost_without_a_word() {
    let params = ElmParams::new(60);
    let (x, t) = chunk(0, |_| 0.5);
    let mut rows = Accumulator::from_sample(&params, &x, 1).unwrap();
    rows.push(&x, &t).unwrap();
    let before = rows.clone();
    let (x, t) = chunk(1, |_| 0.5);
    let refused = rows.push(&x, &t);
    let (constant, value) = (0.5, x[[0, 1]]);
    let (input, row) = (1, 0);
    let expected = Error::ConstantInput {
        input,
        row,
        constant,
        value,
    };
    assert_eq!(refused, Err(expected));
    assert_eq!(rows, before);
    // Rows of weight 0 say nothing.
    rows.push_dataset(
        &Dataset::new(&x, &t)
            .unwrap()
            .with_weights(&Array1::zeros(200))
            .unwrap(),
    )
    .unwrap();
    // Who allows it, or ignores the input anyway, is not bothered.
    rows.clone().with_unlike_rows(true).push(&x, &t).unwrap();
    let ignoring = ElmParams::new(60).with_input_scales(vec![1.0, 0.0]);
    let mut ignoring = Accumulator::from_sample(&ignoring, &chunk(0, |_| 0.5).0, 1).unwrap();
    ignoring.push(&x, &t).unwrap();
}

#[test]
fn a_first_chunk_in_which_an_input_hardly_varies_is_noticed_and_can_be_mended() {
    let chunks =
        |silent: fn(usize) -> f64| (0..20).map(move |number| Ok::<_, Error>(chunk(number, silent)));
    let (x, t): (Vec<_>, Vec<_>) = (20..25).map(|number| chunk(number, |_| 0.0)).unzip();
    let judge = |model: &elm::Elm<f64>| {
        let model = model.clone().into_dimensionality().unwrap();
        let each = x
            .iter()
            .zip(&t)
            .map(|(x, t)| rmse(&model, x, &t.column(0).to_owned()));
        each.fold(0.0, f64::max)
    };
    let params = ElmParams::new(60).with_biases(Biases::AtTrainingRows);
    // A thousandth in one row of 200: a thousand times less than elsewhere.
    let hardly = |row: usize| if row == 100 { 1e-3 } else { 0.0 };
    let (first, t_first) = chunk(0, hardly);
    let mut rows = Accumulator::from_sample(&params, &first, 1).unwrap();
    rows.push(&first, &t_first).unwrap();
    let (next, t_next) = chunk(1, hardly);
    let refused = rows.push(&next, &t_next);
    assert!(
        matches!(
            refused,
            Err(Error::UnlikeRows {
                input: 1,
                rows: 400,
                ..
            })
        ),
        "{refused:?}"
    );
    // A one in 200 rows is not magnified.
    let single = |row: usize| if row == 100 { 1.0 } else { 0.0 };
    let mut rows = Accumulator::from_sample(&params, &chunk(0, single).0, 1).unwrap();
    for chunk in chunks(single) {
        let (x, t) = chunk.unwrap();
        rows.push(&x, &t).unwrap();
    }
    assert!(judge(&rows.fit().unwrap()) < 0.02);
    // Chunks are measured together until there are a thousand rows, or beforehand, all of them.
    for silent in [hardly, single, |_| 0.5] {
        assert!(judge(&params.fit_chunks(chunks(silent)).unwrap()) < 0.02);
        let mut measured = ScalerBuilder::new(2).unwrap();
        chunks(silent).for_each(|chunk| measured.push(&chunk.unwrap().0).unwrap());
        let model = params.fit_chunks_scaled(measured.build().unwrap(), chunks(silent));
        assert!(judge(&model.unwrap()) < 0.02);
    }
}

#[test]
fn outliers_and_long_tails_are_no_other_distribution() {
    let params = ElmParams::new(10).with_solver(Ridge::gcv());
    // Of a Student t of two degrees, whose variance does not exist.
    let (a, b) = (normal::<f64>(20_000, 1, 1), normal::<f64>(20_000, 2, 2));
    let lengths = b
        .map_axis(Axis(1), |row| (row.dot(&row) / 2.0).sqrt())
        .insert_axis(Axis(1));
    let x = a / lengths;
    let t = x.mapv(f64::tanh);
    for rows in [50, 1000] {
        let mut accumulator =
            Accumulator::from_sample(&params, &x.slice(s![..rows, ..]), 1).unwrap();
        for start in (0..20_000).step_by(rows) {
            let range = s![start..start + rows, ..];
            accumulator.push(&x.slice(range), &t.slice(range)).unwrap();
        }
    }
    let mut accumulator = Accumulator::from_sample(&params, &x, 1).unwrap();
    accumulator
        .push(&array![[1e9], [-1e9]], &array![[1.0], [-1.0]])
        .unwrap();
}

/// Rows of one number and a category of `levels` levels, as columns of 0 and 1, each level with an
/// effect of its own; and noise.
fn categories(rows: usize, levels: usize, seed: u64) -> (Array2<f64>, Array1<f64>, Array1<f64>) {
    let effects = normal::<f64>(levels, 1, 77);
    let draws = normal::<f64>(rows, 2, seed);
    let level = |row: usize| (row * 7 + row / levels + seed as usize) % levels;
    let x = Array2::from_shape_fn((rows, levels + 1), |(row, j)| match j {
        0 => draws[[row, 0]],
        j => f64::from(u8::from(level(row) == j - 1)),
    });
    let truth = Array1::from_shape_fn(rows, |row| x[[row, 0]].sin() + effects[[level(row), 0]]);
    let noise = draws.column(1).mapv(|z| 0.22 * z);
    (x, &truth + &noise, truth)
}

#[test]
fn a_category_of_many_levels_does_not_saturate_the_layer() {
    let (x, t, _) = categories(1000, 50, 1);
    let (test, _, truth) = categories(1000, 50, 2);
    let mean = x.mean_axis(Axis(0)).unwrap();
    let deviations = Scaler::new(&mean, &x.std_axis(Axis(0), 0.0)).unwrap();
    for (links, bound) in [(false, 0.2), (true, 0.1)] {
        let params = ElmParams::new(100).with_direct_links(links);
        let layer = params.feature_map().draw(51).unwrap();
        let map = FeatureMap::new(Some(deviations.clone()), layer, links).unwrap();
        let blown_up = params.fit_map(map, &Dataset::new(&x, &t).unwrap());
        let blown_up = rmse(&blown_up.unwrap(), &test, &truth);
        let error = rmse(&params.fit(&x, &t).unwrap(), &test, &truth);
        // 51 coefficients alone cost the noise of 0.22 times the root of 51 / 1000, 0.05.
        assert!(
            error < bound && error < 0.7 * blown_up,
            "{error} {blown_up}"
        );
    }
}
