//! Networks, classifiers and accumulators, as JSON and in binary.

use elm::classify::ElmClassifier;
use elm::persist::{self, Persist};
use elm::solve::{PseudoInverse, Ridge};
use elm::uncertainty::CompactUncertainElm;
use elm::{Accumulator, Activation, Biases, Dataset, Elm, ElmParams, NeuronGroup, Scalar};
use ndarray::{Array2, Axis};

use super::{Reader, Seed, read};

pub(super) const MODEL: Reader = Reader {
    name: "model",
    seeds: models,
    read: |bytes| any_precision(bytes, use_model::<f64>, use_model::<f32>),
};

pub(super) const ACCUMULATOR: Reader = Reader {
    name: "accumulator",
    seeds: accumulators,
    read: |bytes| any_precision(bytes, use_accumulator::<f64>, use_accumulator::<f32>),
};

pub(super) const UNCERTAIN: Reader = Reader {
    name: "uncertain",
    seeds: uncertain,
    read: |bytes| any_precision(bytes, use_uncertain::<f64>, use_uncertain::<f32>),
};

pub(super) const CLASSIFIER: Reader = Reader {
    name: "classifier",
    seeds: classifiers,
    read: |bytes| any_precision(bytes, use_classifier::<f64>, use_classifier::<f32>),
};

/// Reads as both precisions, and once more with the head of a binary file put right, without
/// which the checksum would keep every mutation from the decoder.
fn any_precision<T: Persist, U: Persist>(
    bytes: &[u8],
    one: impl Fn(&T),
    other: impl Fn(&U),
) -> bool {
    let mended = mended(bytes);
    let whole = check(bytes, &one) | check(bytes, &other);
    if let Some(mended) = mended {
        return whole | check(&mended, &one) | check(&mended, &other);
    }
    whole
}

fn check<T: Persist>(bytes: &[u8], then: impl Fn(&T)) -> bool {
    let Some(value) = read(bytes, || persist::from_bytes::<T>(bytes)) else {
        return false;
    };
    let binary = persist::to_bytes(&value).expect("what was read can be written");
    let text = persist::to_json(&value).expect("what was read can be written");
    for form in [&binary, text.as_bytes()] {
        let again: T = persist::from_bytes(form).expect("what was written can be read");
        assert!(
            persist::to_bytes(&again).is_ok_and(|again| again == binary),
            "another value"
        );
    }
    then(&value);
    true
}

/// The bytes with the length and the checksum that belong to their payload.
fn mended(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut at = 8 + 4;
    for _ in 0..2 {
        at += 1 + usize::from(*bytes.get(at)?);
    }
    let payload = bytes.get(at + 12..)?;
    let mut mended = bytes.get(..at)?.to_vec();
    mended.extend((payload.len() as u64).to_le_bytes());
    mended.extend(crc32fast::hash(payload).to_le_bytes());
    mended.extend(payload);
    Some(mended)
}

/// Some rows that a network of `inputs` inputs might be given.
fn rows<A: Scalar>(inputs: usize) -> Array2<A> {
    Array2::from_shape_fn((3, inputs), |(row, input)| {
        A::from_f64(row as f64 - 0.3 * input as f64)
    })
}

fn use_model<A: Scalar>(model: &Elm<A>) {
    // Wide enough for anything but a file that lies.
    if model.inputs() > 1 << 12 {
        return;
    }
    let x = rows::<A>(model.inputs());
    if let Ok(y) = model.predict(&x) {
        assert_eq!(y.dim(), (3, model.outputs()));
        assert!(
            y.iter().all(|value| value.is_finite()),
            "a prediction that is no number: {y}"
        );
    }
}

fn use_uncertain<A: Scalar>(model: &CompactUncertainElm<A>) {
    let network = model.model();
    if network.inputs() > 1 << 12 {
        return;
    }
    let x = rows::<A>(network.inputs());
    if let Ok(deviation) = model.predict_deviation(&x) {
        assert_eq!(deviation.dim(), (3, network.outputs()));
        assert!(deviation.iter().all(|value| value.is_finite()));
    }
    if let Ok((low, high)) = model.predict_interval(&x, 0.5) {
        assert_eq!([low.dim(), high.dim()], [(3, network.outputs()); 2]);
        assert!(low.iter().chain(&high).all(|value| !value.is_nan()));
    }
}

fn use_classifier<A: Scalar>(model: &ElmClassifier<A, u32>) {
    if model.model().inputs() > 1 << 12 {
        return;
    }
    let x = rows::<A>(model.model().inputs());
    if let Ok(p) = model.predict_proba(&x) {
        assert_eq!(p.dim(), (3, model.classes().len()));
        assert!(
            p.iter().all(|p| (A::zero()..=A::one()).contains(p)),
            "probabilities {p}"
        );
    }
}

fn use_accumulator<A: Scalar>(accumulator: &Accumulator<A>) {
    let mut both = accumulator.clone();
    both.merge(accumulator).ok();
    for accumulator in [accumulator, &both] {
        if let Ok(model) = accumulator.fit() {
            assert!(model.beta().iter().all(|value| value.is_finite()));
            let x = rows::<A>(model.inputs());
            let t = Array2::<A>::ones((3, model.outputs()));
            let mut more = accumulator.clone();
            if more.push(&x, &t).is_ok() {
                assert_eq!(more.rows(), accumulator.rows().saturating_add(3));
                more.fit().ok();
            }
            use_model(&model);
        }
    }
}

fn data<A: Scalar>() -> (Array2<A>, Array2<A>) {
    let x = Array2::from_shape_fn((8, 2), |(i, j)| {
        A::from_f64(((i * (j + 2)) as f64 * 0.7).sin())
    });
    let t = x.map_axis(Axis(1), |row| row[0] * row[1] + row[0]);
    (x, t.insert_axis(Axis(1)))
}

fn seed<T: Persist>(name: &'static str, json: bool, value: &T) -> Seed {
    let bytes = if json {
        persist::to_json(value)
            .expect("a built-in activation")
            .into_bytes()
    } else {
        persist::to_bytes(value).expect("a built-in activation")
    };
    Seed { name, bytes }
}

fn models() -> Vec<Seed> {
    fn fit<A: Scalar>(params: &ElmParams<A>) -> Elm<A> {
        let (x, t) = data();
        params.fit(&x, &t).expect("rows without a fault")
    }
    let plain = fit(&ElmParams::<f64>::new(3));
    let linked = ElmParams::<f64>::new(2)
        .with_solver(PseudoInverse::default())
        .with_activation(Activation::Sine)
        .with_biases(Biases::AtTrainingRows)
        .with_direct_links(true)
        .with_standardize(false)
        .with_intercept(false);
    let mixed = ElmParams::<f64>::new(1)
        .with_group(NeuronGroup::new(1, Activation::Sine))
        .with_group(NeuronGroup::rbf(2));
    let single = fit(&ElmParams::<f32>::new(2).with_solver(Ridge::relative(1e-3)));
    let mut broken = persist::to_bytes(&plain).expect("a built-in activation");
    broken.truncate(broken.len() / 2);
    vec![
        seed("plain.json", true, &plain),
        seed("plain.elm", false, &plain),
        seed("linked.elm", false, &fit(&linked)),
        seed("mixed.elm", false, &fit(&mixed)),
        seed("mixed.json", true, &fit(&mixed)),
        seed("single.json", true, &single),
        seed("single.elm", false, &single),
        Seed {
            name: "bad-half.elm",
            bytes: broken,
        },
    ]
}

fn uncertain() -> Vec<Seed> {
    fn fit<A: Scalar>(members: usize) -> CompactUncertainElm<A> {
        let (x, t) = data();
        let data = Dataset::new(&x, &t).expect("rows without a fault");
        let params = ElmParams::<A>::new(2).with_solver(Ridge::relative(1e-3));
        let fitted = params.fit_ensemble(members, &data);
        fitted.expect("rows without a fault").compact()
    }
    vec![
        seed("one.json", true, &fit::<f64>(1)),
        seed("one.elm", false, &fit::<f64>(1)),
        seed("two.elm", false, &fit::<f64>(2)),
        seed("single.elm", false, &fit::<f32>(1)),
    ]
}

fn classifiers() -> Vec<Seed> {
    fn fit<A: Scalar>(classes: u32) -> ElmClassifier<A, u32> {
        let (x, _) = data::<A>();
        let labels: Vec<u32> = (0..8).map(|row| row % classes).collect();
        let params = ElmParams::<A>::new(2);
        params
            .fit_classifier(&x, &labels)
            .expect("rows without a fault")
    }
    vec![
        seed("two.json", true, &fit::<f64>(2)),
        seed("two.elm", false, &fit::<f64>(2)),
        seed("three.elm", false, &fit::<f64>(3)),
        seed("single.elm", false, &fit::<f32>(3)),
    ]
}

fn accumulators() -> Vec<Seed> {
    fn filled<A: Scalar>(params: &ElmParams<A>, times: usize) -> Accumulator<A> {
        let (x, t) = data();
        let mut accumulator =
            Accumulator::from_sample(params, &x, 1).expect("rows without a fault");
        for _ in 0..times {
            accumulator.push(&x, &t).expect("rows without a fault");
        }
        accumulator
    }
    let ridge = filled(&ElmParams::<f64>::new(2).with_solver(Ridge::gcv()), 3);
    vec![
        seed("empty.elm", false, &filled(&ElmParams::<f64>::new(1), 0)),
        seed("ridge.json", true, &ridge),
        seed("ridge.elm", false, &ridge),
        seed(
            "linked.elm",
            false,
            &filled(
                &ElmParams::<f64>::new(1)
                    .with_solver(PseudoInverse::default())
                    .with_direct_links(true)
                    .with_intercept(false),
                2,
            ),
        ),
        seed("single.json", true, &filled(&ElmParams::<f32>::new(1), 4)),
        // Sums of products.
        seed(
            "strong.elm",
            false,
            &filled(
                &ElmParams::<f64>::new(2).with_solver(Ridge::relative(1e-3)),
                3,
            ),
        ),
    ]
}
