//! Rows of inputs with a label each, and the weights of classes.

use ndarray::{Array1, Array2, ArrayRef1, ArrayView2};

use crate::check::{check_finite, check_length, check_weights};
use crate::dataset::Inputs;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// What the rows of each class count for, on top of the weights of rows.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub enum ClassWeights<L> {
    /// Every row counts for its own weight.
    #[default]
    Equal,
    /// All classes count for the same in sum: a class of weight $W_k$ in rows has $W / (K W_k)$, with $W$
    /// the weight of all rows and $K$ the number of classes that have any.
    Balanced,
    /// These weights; 1 for classes that are not named.
    Given(Vec<(L, f64)>),
}

/// Inputs and a label for each row, checked once. The classes are the labels that occur, in rising order,
/// unless [others are set](Self::with_classes).
///
/// ```
/// use elm::classify::{ClassWeights, LabeledRows};
/// use ndarray::array;
///
/// let x = array![[0.0], [0.1], [1.0], [1.1], [1.2]];
/// let rows = LabeledRows::new(&x, &["low", "low", "high", "high", "high"])?
///     .with_class_weights(ClassWeights::Balanced)?;
/// assert_eq!(rows.classes(), ["high", "low"]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct LabeledRows<'a, A: Scalar, L> {
    inputs: ArrayView2<'a, A>,
    classes: Vec<L>,
    /// The class of each row, by its number.
    codes: Vec<usize>,
    row_weights: Option<Array1<A>>,
    class_weights: Option<Vec<f64>>,
}

impl<'a, A: Scalar, L: Ord + Clone> LabeledRows<'a, A, L> {
    /// `x` has shape (rows, inputs), `labels` one entry per row.
    ///
    /// # Errors
    /// [`Error::Shape`] for another number of labels, [`Error::NotFinite`] at the first NaN or infinity.
    pub fn new<X: Inputs<A> + ?Sized>(x: &'a X, labels: &[L]) -> Result<Self> {
        let mut classes = labels.to_vec();
        classes.sort_unstable();
        classes.dedup();
        Self::of_classes(x, labels, classes)
    }

    /// As [`new`](Self::new), of these classes, some of which may have no rows. Order and repetition of
    /// `classes` do not matter.
    ///
    /// # Errors
    /// Those of [`new`](Self::new); [`Error::UnknownClass`] naming the first row of another class.
    pub fn with_classes<X: Inputs<A> + ?Sized>(
        x: &'a X,
        labels: &[L],
        classes: &[L],
    ) -> Result<Self> {
        let mut classes = classes.to_vec();
        classes.sort_unstable();
        classes.dedup();
        Self::of_classes(x, labels, classes)
    }

    fn of_classes<X: Inputs<A> + ?Sized>(x: &'a X, labels: &[L], classes: Vec<L>) -> Result<Self> {
        let inputs = x.as_matrix();
        check_finite("inputs", inputs)?;
        check_length("labels", labels.len(), inputs.nrows())?;
        let code = |(row, label)| {
            let found = classes.binary_search(label);
            found.map_err(|_| Error::UnknownClass { row })
        };
        let codes = labels.iter().enumerate().map(code).collect::<Result<_>>()?;
        Ok(Self {
            inputs,
            classes,
            codes,
            row_weights: None,
            class_weights: None,
        })
    }

    /// A weight for each row.
    ///
    /// # Errors
    /// [`Error::Shape`] when there is not one per row, [`Error::Parameter`] when one is negative or not
    /// finite.
    #[doc(alias = "sample_weight")]
    pub fn with_weights(mut self, weights: &ArrayRef1<A>) -> Result<Self> {
        check_weights(weights.view(), self.rows())?;
        self.row_weights = Some(weights.to_owned());
        Ok(self)
    }

    /// What the rows of each class count for.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a weight that is negative or not finite.
    #[doc(alias = "class_weight")]
    pub fn with_class_weights(mut self, weights: ClassWeights<L>) -> Result<Self> {
        self.class_weights = match weights {
            ClassWeights::Equal => None,
            ClassWeights::Balanced => Some(self.balanced()),
            ClassWeights::Given(given) => {
                let mut weights = vec![1.0; self.classes.len()];
                for (label, weight) in given {
                    if !(weight >= 0.0 && weight.is_finite()) {
                        return Err(Error::Parameter {
                            name: "class weight",
                            value: weight,
                            expected: "finite and not negative",
                        });
                    }
                    if let Ok(class) = self.classes.binary_search(&label) {
                        weights[class] = weight;
                    }
                }
                Some(weights)
            }
        };
        Ok(self)
    }

    fn balanced(&self) -> Vec<f64> {
        let mut of_class = vec![0.0; self.classes.len()];
        for (row, &code) in self.codes.iter().enumerate() {
            of_class[code] += self.row_weights.as_ref().map_or(1.0, |w| w[row].as_f64());
        }
        let total: f64 = of_class.iter().sum();
        let present = of_class.iter().filter(|w| **w > 0.0).count() as f64;
        let weight = |&of: &f64| {
            if of > 0.0 {
                total / (present * of)
            } else {
                1.0
            }
        };
        of_class.iter().map(weight).collect()
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.inputs.nrows()
    }

    /// The classes, rising.
    #[must_use]
    pub fn classes(&self) -> &[L] {
        &self.classes
    }

    /// The class of each row, by its index in [`classes`](Self::classes).
    #[must_use]
    pub fn codes(&self) -> &[usize] {
        &self.codes
    }

    /// The inputs, shape (rows, inputs).
    #[must_use]
    pub fn inputs(&self) -> ArrayView2<'_, A> {
        self.inputs.view()
    }

    /// What each row counts for: its weight times that of its class; nothing where all count for 1.
    #[must_use]
    pub fn weights(&self) -> Option<Array1<A>> {
        let Some(of_class) = &self.class_weights else {
            return self.row_weights.clone();
        };
        let of_row = |row: usize| self.row_weights.as_ref().map_or(1.0, |w| w[row].as_f64());
        let both = |(row, &code): (usize, &usize)| A::from_f64(of_class[code] * of_row(row));
        Some(self.codes.iter().enumerate().map(both).collect())
    }

    /// One target for each class, 1 in the rows of the class and 0 in all others; of two classes the
    /// second's alone, as the first's is 1 less that.
    pub(super) fn targets(&self) -> Array2<A> {
        targets(&self.codes, self.classes.len())
    }

    /// Whether rows that count are of several classes.
    ///
    /// # Errors
    /// [`Error::OneClass`] where they are not, [`Error::Empty`] without rows.
    pub(super) fn check_several(&self) -> Result<()> {
        if self.rows() == 0 {
            let (rows, columns) = self.inputs.dim();
            return Err(Error::Empty {
                what: "inputs",
                rows,
                columns,
            });
        }
        let weights = self.weights();
        let counts = |row: &usize| weights.as_ref().is_none_or(|w| w[*row] > A::zero());
        let mut codes = (0..self.rows()).filter(counts).map(|row| self.codes[row]);
        match codes.next() {
            // The fit says that all weights are 0.
            None => Ok(()),
            Some(first) if codes.any(|code| code != first) => Ok(()),
            Some(_) => Err(Error::OneClass),
        }
    }
}

pub(super) fn targets<A: Scalar>(codes: &[usize], classes: usize) -> Array2<A> {
    if classes == 2 {
        let second = |(row, _)| A::from_f64(codes[row] as f64);
        return Array2::from_shape_fn((codes.len(), 1), second);
    }
    let mut targets = Array2::zeros((codes.len(), classes));
    for (row, &code) in codes.iter().enumerate() {
        targets[[row, code]] = A::one();
    }
    targets
}
