//! Settings as files.

use elm::solve::{Inverse, PseudoInverse, Ridge, Solver};
use elm::tune::Trial;
use elm::{Activation, Biases, Distribution, ElmParams, NeuronGroup, NodeType};

type Params = ElmParams<f64>;

fn read(text: &str) -> Params {
    serde_json::from_str(text).unwrap()
}

fn refusal(text: &str) -> String {
    serde_json::from_str::<Params>(text)
        .unwrap_err()
        .to_string()
}

/// Every setting other than its default.
fn unusual() -> Params {
    Params::new(7)
        .with_activation(Activation::Sine)
        .with_node_type(NodeType::Additive)
        .with_biases(Biases::Scaled(0.5))
        .with_group(NeuronGroup::rbf(3).with_scale(2.0))
        .with_distribution(Distribution::StudentT(3))
        .with_scale(0.1)
        .with_input_scales(vec![1.0, 0.25])
        .with_seed(u64::MAX)
        .with_solver(Ridge::relative(1e-3).with_shared(true))
        .with_intercept(false)
        .with_standardize(false)
        .with_direct_links(true)
        .with_bounded(false)
}

#[test]
fn what_is_missing_has_its_default() {
    assert_eq!(read(r#"{"neurons": 20}"#), Params::new(20));
    let text = r#"{"neurons": 20, "activation": "tanh", "biases": "on-data",
                   "and": [{"count": 5}], "solver": {"ridge": {"shared": true}}}"#;
    let same = Params::new(20)
        .with_activation(Activation::Tanh)
        .with_biases(Biases::AtTrainingRows)
        .with_group(NeuronGroup::new(5, Activation::default()))
        .with_solver(Ridge::default().with_shared(true));
    assert_eq!(read(text), same);
    let error = refusal("{}");
    assert!(error.contains("missing field `neurons`"), "{error}");
}

#[test]
fn a_solver_may_be_a_name() {
    let solver = |text: &str| serde_json::from_str::<Solver>(text).unwrap();
    assert_eq!(solver(r#""ridge""#), Ridge::default().into());
    assert_eq!(solver(r#"{"ridge": {}}"#), Ridge::default().into());
    assert_eq!(
        solver(r#""pseudo-inverse""#),
        PseudoInverse::default().into()
    );
    assert_eq!(solver(r#""inverse""#), Inverse.into());
    let error = refusal(r#"{"neurons": 2, "solver": "rigde"}"#);
    assert!(
        error.contains("'rigde'") && error.contains("ridge"),
        "{error}"
    );
}

#[test]
fn a_name_that_is_not_a_setting_is_refused_by_name() {
    for (text, name) in [
        (r#"{"neurons": 20, "sclae": 0.5}"#, "sclae"),
        (
            r#"{"neurons": 20, "and": [{"count": 2, "sacle": 1}]}"#,
            "sacle",
        ),
        (
            r#"{"neurons": 20, "solver": {"ridge": {"lamda": "gcv"}}}"#,
            "lamda",
        ),
        (
            r#"{"neurons": 20, "solver": {"pseudo-inverse": {"cut": 0.1}}}"#,
            "cut",
        ),
        (
            r#"{"neurons": {"count": 20, "activasion": "tanh"}}"#,
            "activasion",
        ),
    ] {
        let error = refusal(text);
        assert!(
            error.contains(&format!("unknown field `{name}`")),
            "{error}"
        );
    }
    for text in [
        r#"{"neurons": -3}"#,
        r#"{"neurons": 2.5}"#,
        r#"{"neurons": "many"}"#,
    ] {
        assert!(serde_json::from_str::<Params>(text).is_err(), "{text}");
    }
}

#[test]
fn what_is_written_is_read_again() {
    for params in [Params::new(1), unusual()] {
        let text = serde_json::to_string(&params).unwrap();
        assert_eq!(read(&text), params, "{text}");
        let bytes = postcard::to_stdvec(&params).unwrap();
        assert_eq!(postcard::from_bytes::<Params>(&bytes).unwrap(), params);
    }
    // As it was written once.
    let nested = r#"{"neurons": {"count": 4, "activation": "tanh", "kind": "radial", "scale": 1.0,
                     "biases": "as-weights"}, "others": []}"#;
    let same = Params::new(4)
        .with_activation(Activation::Tanh)
        .with_node_type(NodeType::Rbf);
    assert_eq!(read(nested), same);
}

#[test]
fn a_custom_activation_is_never_mistaken_for_a_built_in_one() {
    let own = Activation::custom("tanh", |z: f64| z * z);
    let error = serde_json::to_string(&own).unwrap_err().to_string();
    assert!(
        error.contains("'tanh'") && error.contains("custom"),
        "{error}"
    );
    for params in [
        Params::new(5).with_activation(own.clone()),
        Params::new(5).with_group(NeuronGroup::new(2, own)),
    ] {
        assert!(serde_json::to_string(&params).is_err());
        assert!(postcard::to_stdvec(&params).is_err());
    }
}

#[test]
fn numbers_that_json_has_no_place_for_are_refused_by_name() {
    for (params, name) in [
        (Params::new(5).with_scale(f64::NAN), "scale"),
        (Params::new(5).with_scale(f64::INFINITY), "scale"),
        (
            Params::new(5).with_input_scales(vec![f64::NAN]),
            "input_scales",
        ),
        (
            Params::new(5).with_biases(Biases::Scaled(f64::NAN)),
            "biases",
        ),
        (
            Params::new(5).with_solver(Ridge::relative(f64::NAN)),
            "lambda",
        ),
        (
            Params::new(5).with_solver(PseudoInverse::with_cutoff(f64::NAN)),
            "cutoff",
        ),
        (
            Params::new(5).with_group(NeuronGroup::rbf(2).with_scale(f64::NAN)),
            "scale of neurons",
        ),
    ] {
        let error = serde_json::to_string(&params).unwrap_err().to_string();
        assert!(error.starts_with(name), "{error}");
    }
    assert!(serde_json::to_string(&Ridge::relative(f64::NAN)).is_err());
    assert!(serde_json::to_string(&Biases::Scaled(f64::NAN)).is_err());
    assert!(serde_json::to_string(&PseudoInverse::with_cutoff(f64::NAN)).is_err());
}

#[test]
fn a_trial_without_a_score_is_read_again() {
    let trial = Trial {
        neurons: 3,
        scale: 1.0,
        input_scales: Vec::new(),
        direct_links: false,
        score: f64::INFINITY,
    };
    let text = serde_json::to_string(&trial).unwrap();
    assert_eq!(
        serde_json::from_str::<Trial>(&text).unwrap(),
        trial,
        "{text}"
    );
}
