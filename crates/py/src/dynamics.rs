//! Virtual tests: the classes of `rthstrack.virtual_test` to the core's, signals back.

use numpy::{Complex64, IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, ndarray::Array2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::Error;
use rthstrack::dynamics::{
    Actuator, BoucWen, Compensation, Converter, Damping, Delay, Dynamics, Element, Law, Mistake, Motion, Run,
    ServoHydraulic, Stepping, Structure, TestConfig,
};

use crate::error::{choice, to_py};
use crate::named::named;

/// (key, message)
type Mistakes = Vec<(String, String)>;
/// A structure's matrices, or everything that is wrong with it.
type Built<'py> = (Option<Bound<'py, PyDict>>, Mistakes);

fn pairs(mistakes: &[Mistake]) -> Mistakes {
    mistakes.iter().map(|m| (m.key.clone(), m.message.clone())).collect()
}

fn kind(object: &Bound<'_, PyAny>) -> PyResult<String> {
    Ok(object.get_type().name()?.to_string())
}

fn number(object: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    object.getattr(name)?.extract()
}

fn unknown(what: &str, name: &str) -> PyErr {
    PyTypeError::new_err(format!("{name} is not a {what} of rthstrack.virtual_test"))
}

/// A law; `whole` is the stiffness meant by None.
fn law(object: &Bound<'_, PyAny>, whole: f64) -> PyResult<Law> {
    let name = kind(object)?;
    let stiffness =
        || -> PyResult<f64> { Ok(object.getattr("stiffness_n_per_m")?.extract::<Option<f64>>()?.unwrap_or(whole)) };
    let damping = || number(object, "damping_n_s_per_m");
    let hysteresis = || -> PyResult<BoucWen> {
        Ok(BoucWen {
            stiffness: stiffness()?,
            yield_displacement: number(object, "yield_displacement_m")?,
            post_yield_ratio: number(object, "post_yield_ratio")?,
            beta: number(object, "beta")?,
            gamma: number(object, "gamma")?,
            exponent: number(object, "exponent")?,
        })
    };
    Ok(match name.as_str() {
        "Spring" => Law::Spring { stiffness: stiffness()? },
        "Dashpot" => Law::Dashpot { damping: damping()? },
        "KelvinVoigt" => Law::KelvinVoigt { stiffness: stiffness()?, damping: damping()? },
        "Maxwell" => Law::Maxwell { stiffness: stiffness()?, damping: damping()? },
        "BoucWen" => Law::BoucWen(hysteresis()?),
        "BaberWen" => Law::BaberWen {
            hysteresis: hysteresis()?,
            strength: number(object, "strength_degradation")?,
            stiffness: number(object, "stiffness_degradation")?,
        },
        _ => return Err(unknown("restoring force", &name)),
    })
}

fn delay(object: &Bound<'_, PyAny>) -> PyResult<Delay> {
    if let Ok(constant) = object.extract::<f64>() {
        return Ok(Delay::Constant(constant));
    }
    let (time_s, delay_s) = (object.getattr("time_s")?.extract()?, object.getattr("delay_s")?.extract()?);
    Ok(Delay::Varying { time_s, delay_s })
}

fn dynamics(object: &Bound<'_, PyAny>) -> PyResult<Dynamics> {
    if object.is_none() {
        return Ok(Dynamics::None);
    }
    let name = kind(object)?;
    Ok(match name.as_str() {
        "FirstOrder" => Dynamics::FirstOrder { alpha: number(object, "alpha")? },
        "TransferFunction" => Dynamics::TransferFunction {
            numerator: object.getattr("numerator")?.extract()?,
            denominator: object.getattr("denominator")?.extract()?,
        },
        "ServoHydraulic" => Dynamics::ServoHydraulic(ServoHydraulic {
            gain: number(object, "gain")?,
            a1b0: number(object, "a1b0")?,
            a2: number(object, "a2")?,
            a3: number(object, "a3")?,
            b1: number(object, "b1")?,
            b2: number(object, "b2")?,
        }),
        _ => return Err(unknown("model of an actuator's dynamics", &name)),
    })
}

/// A compensator, its kind and its numbers as its class has them.
fn compensation(object: &Bound<'_, PyAny>) -> PyResult<Compensation> {
    if object.is_none() {
        return Ok(Compensation::NONE);
    }
    let py = object.py();
    let name: String = match object.getattr("kind") {
        Ok(name) => name.extract()?,
        Err(_) => return Err(unknown("compensation", &kind(object)?)),
    };
    Compensation::new(&name, |parameter| number(object, parameter).ok()).map_err(|error| to_py(py, &error))
}

fn converter(object: &Bound<'_, PyAny>) -> PyResult<Converter> {
    Ok(Converter { limit: number(object, "limit")?, quantum: number(object, "quantum")? })
}

/// The stiffness between two places, where both exist.
fn between(structure: &Structure, dof: usize, from_dof: usize) -> f64 {
    let n = structure.n_dof();
    let placed = (1..=n).contains(&dof) && from_dof <= n && dof != from_dof;
    if placed { structure.stiffness_between(dof, from_dof) } else { 1.0 }
}

fn element(object: &Bound<'_, PyAny>, structure: &Structure) -> PyResult<Element> {
    let (dof, from_dof) = (object.getattr("dof")?.extract()?, object.getattr("from_dof")?.extract()?);
    Ok(Element {
        law: law(&object.getattr("law")?, between(structure, dof, from_dof))?,
        dof,
        from_dof,
        part_of_structure: object.getattr("part_of_structure")?.extract()?,
    })
}

fn actuator(object: &Bound<'_, PyAny>, structure: &Structure) -> PyResult<Actuator> {
    let (dof, from_dof) = (object.getattr("dof")?.extract()?, object.getattr("from_dof")?.extract()?);
    let whole = between(structure, dof, from_dof);
    Ok(Actuator {
        dof,
        from_dof,
        specimen: object.getattr("specimen")?.try_iter()?.map(|item| law(&item?, whole)).collect::<PyResult<_>>()?,
        specimen_mass: number(object, "specimen_mass_kg")?,
        part_of_structure: object.getattr("part_of_structure")?.extract()?,
        gain: number(object, "gain")?,
        delay: delay(&object.getattr("delay_s")?)?,
        dynamics: dynamics(&object.getattr("dynamics")?)?,
        compensation: compensation(&object.getattr("compensation")?)?,
        command_converter: converter(&object.getattr("command_converter")?)?,
        displacement_sensor: converter(&object.getattr("displacement_sensor")?)?,
        force_sensor: converter(&object.getattr("force_sensor")?)?,
        force_delay_samples: object.getattr("force_delay_samples")?.extract()?,
    })
}

/// A damping of `rthstrack.virtual_test`, or a matrix.
fn damping(object: &Bound<'_, PyAny>) -> PyResult<Damping> {
    let name = kind(object)?;
    Ok(match name.as_str() {
        "ModalDamping" => {
            let ratios = object.getattr("ratios")?;
            Damping::Modal(match ratios.extract::<f64>() {
                Ok(one) => vec![one],
                Err(_) => ratios.extract()?,
            })
        }
        "RayleighDamping" => {
            let modes: [i64; 2] = object.getattr("modes")?.extract()?;
            // There is no mode 0 either.
            let modes = modes.map(|m| usize::try_from(m).unwrap_or(0));
            Damping::Rayleigh { ratios: object.getattr("ratios")?.extract()?, modes }
        }
        _ => Damping::Matrix(object.extract::<PyReadonlyArray2<'_, f64>>()?.as_slice().map_err(contiguous)?.to_vec()),
    })
}

fn contiguous(_: impl std::fmt::Debug) -> PyErr {
    PyValueError::new_err("the array must be C-contiguous")
}

fn built<'py>(py: Python<'py>, structure: Result<Structure, Vec<Mistake>>) -> PyResult<Built<'py>> {
    let structure = match structure {
        Ok(structure) => structure,
        Err(mistakes) => return Ok((None, pairs(&mistakes))),
    };
    let n = structure.n_dof();
    let [m, c, k] =
        structure.matrices().map(|rows| Array2::from_shape_vec((n, n), rows).expect("n x n").into_pyarray(py));
    let frequencies = structure.natural_frequencies_hz().to_vec();
    let matrices = named!(py, (); ; mass_kg: m, damping_n_s_per_m: c, stiffness_n_per_m: k,
        natural_frequencies_hz: frequencies)?;
    Ok((Some(matrices), Vec::new()))
}

#[pyfunction]
fn sdof(py: Python<'_>, frequency_hz: f64, damping_ratio: f64, mass_kg: f64) -> PyResult<Built<'_>> {
    built(py, Structure::sdof(frequency_hz, damping_ratio, mass_kg))
}

#[pyfunction]
fn shear_building<'py>(
    py: Python<'py>,
    masses_kg: Vec<f64>,
    stiffnesses: Vec<f64>,
    damped: &Bound<'py, PyAny>,
) -> PyResult<Built<'py>> {
    built(py, Structure::shear_building(&masses_kg, &stiffnesses, &damping(damped)?))
}

#[pyfunction]
fn from_matrices<'py>(
    py: Python<'py>,
    mass: PyReadonlyArray2<'py, f64>,
    stiffness: PyReadonlyArray2<'py, f64>,
    damped: &Bound<'py, PyAny>,
    influence: Vec<f64>,
) -> PyResult<Built<'py>> {
    let n = mass.as_array().nrows();
    let (mass, stiffness) = (mass.as_slice().map_err(contiguous)?, stiffness.as_slice().map_err(contiguous)?);
    built(py, Structure::from_matrices(n, mass, stiffness, &damping(damped)?, Some(&influence)))
}

/// The core's configuration of a `rthstrack.virtual_test.VirtualTest`; its structure is checked already.
fn configuration(py: Python<'_>, test: &Bound<'_, PyAny>) -> PyResult<TestConfig> {
    let whole = test.getattr("structure")?;
    let matrix = |name: &str| -> PyResult<Vec<f64>> {
        Ok(whole.getattr(name)?.extract::<PyReadonlyArray2<'_, f64>>()?.as_slice().map_err(contiguous)?.to_vec())
    };
    let influence = whole.getattr("influence")?.extract::<PyReadonlyArray1<'_, f64>>()?;
    let influence = influence.as_slice().map_err(contiguous)?;
    let damping = Damping::Matrix(matrix("damping_n_s_per_m")?);
    let (mass, stiffness) = (matrix("mass_kg")?, matrix("stiffness_n_per_m")?);
    let structure = if influence.is_empty() {
        Structure::none()
    } else {
        Structure::from_matrices(influence.len(), &mass, &stiffness, &damping, Some(influence))
            .map_err(|mistakes| to_py(py, &Error::Configuration(mistakes)))?
    };
    Ok(TestConfig {
        elements: test.getattr("elements")?.try_iter()?.map(|e| element(&e?, &structure)).collect::<PyResult<_>>()?,
        actuators: test
            .getattr("actuators")?
            .try_iter()?
            .map(|a| actuator(&a?, &structure))
            .collect::<PyResult<_>>()?,
        structure,
        stepping: choice(py, "stepping", &Stepping::NAMES, &test.getattr("stepping")?.extract::<String>()?)?,
        rate_hz: number(test, "rate_hz")?,
        tolerance: number(test, "tolerance")?,
        bound_m: test.getattr("bound_m")?.extract()?,
    })
}

/// Everything that is wrong with a `rthstrack.virtual_test.VirtualTest`.
#[pyfunction]
fn check_test(py: Python<'_>, test: &Bound<'_, PyAny>) -> PyResult<Mistakes> {
    match rthstrack::dynamics::VirtualTest::new(configuration(py, test)?) {
        Ok(_) => Ok(Vec::new()),
        Err(Error::Configuration(mistakes)) => Ok(pairs(&mistakes)),
        Err(error) => Err(to_py(py, &error)),
    }
}

/// One matrix (n_samples, n_signals) of a signal a row.
fn columns<'py>(py: Python<'py>, signals: &[Vec<f64>], n_samples: usize) -> Bound<'py, PyArray2<f64>> {
    let mut flat = Vec::with_capacity(n_samples * signals.len());
    for sample in 0..n_samples {
        flat.extend(signals.iter().map(|s| s[sample]));
    }
    Array2::from_shape_vec((n_samples, signals.len()), flat).expect("one sample a row").into_pyarray(py)
}

/// The checked plan of a virtual test.
#[pyclass(frozen, module = "rthstrack._core")]
struct VirtualTest {
    plan: rthstrack::dynamics::VirtualTest,
}

/// The signals, or when and at which bound the test became unstable.
type Outcome<'py> = (Option<Bound<'py, PyDict>>, Option<(f64, f64)>);

fn outcome<'py>(py: Python<'py>, run: rthstrack::Result<Run>) -> PyResult<Outcome<'py>> {
    let run = match run {
        Ok(run) => run,
        Err(Error::Unstable { time_s, bound_m }) => return Ok((None, Some((time_s, bound_m)))),
        Err(error) => return Err(to_py(py, &error)),
    };
    let n_samples = run.target.first().map_or(0, Vec::len);
    let signal = |of: &[Vec<f64>]| columns(py, of, n_samples);
    let signals = named!(py, run; steps_per_sample, error_estimate;
        target: signal(&run.target), command: signal(&run.command), measured: signal(&run.measured),
        force: signal(&run.force), displacement: signal(&run.displacement))?;
    Ok((Some(signals), None))
}

#[pymethods]
impl VirtualTest {
    #[new]
    fn new(py: Python<'_>, test: &Bound<'_, PyAny>) -> PyResult<Self> {
        let config = configuration(py, test)?;
        let plan = rthstrack::dynamics::VirtualTest::new(config).map_err(|e| to_py(py, &e))?;
        Ok(Self { plan })
    }

    /// The signals, or when and at which bound the test became unstable.
    fn run<'py>(
        &self,
        py: Python<'py>,
        ground: PyReadonlyArray1<'py, f64>,
        noise: Vec<Option<Vec<f64>>>,
    ) -> PyResult<Outcome<'py>> {
        let ground = ground.as_slice()?;
        outcome(py, py.detach(|| self.plan.run(ground, &noise)))
    }

    /// The same of actuators alone, which follow a target (n_samples, 3): displacement, velocity, acceleration.
    fn follow<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArray2<'py, f64>,
        noise: Vec<Option<Vec<f64>>>,
    ) -> PyResult<Outcome<'py>> {
        let target: Vec<Motion> = target
            .as_slice()?
            .chunks_exact(3)
            .map(|m| Motion { displacement: m[0], velocity: m[1], acceleration: m[2] })
            .collect();
        outcome(py, py.detach(|| self.plan.follow(&target, &noise)))
    }

    fn critical_delay<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.plan.critical_delay().map_err(|e| to_py(py, &e))?;
        named!(py, found; delay_s, frequency_hz, gain, exact)
    }

    fn delay_damping<'py>(&self, py: Python<'py>, delay_s: f64) -> PyResult<Bound<'py, PyDict>> {
        let found = self.plan.delay_damping(delay_s).map_err(|e| to_py(py, &e))?;
        named!(py, found; frequency_hz, damping_ratio, damping_ratio_without, first_order_change)
    }

    /// None where target to measured is no one linear filter.
    fn true_response<'py>(
        &self,
        py: Python<'py>,
        actuator: usize,
        frequency_hz: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Option<Bound<'py, PyArray1<Complex64>>>> {
        if actuator >= self.plan.config().actuators.len() {
            return Err(pyo3::exceptions::PyIndexError::new_err("no such actuator"));
        }
        let found: Option<Vec<Complex64>> =
            frequency_hz.as_slice()?.iter().map(|f| self.plan.true_response(actuator, *f)).collect();
        Ok(found.map(|values| values.into_pyarray(py)))
    }
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<VirtualTest>()?;
    m.add_function(wrap_pyfunction!(sdof, m)?)?;
    m.add_function(wrap_pyfunction!(shear_building, m)?)?;
    m.add_function(wrap_pyfunction!(from_matrices, m)?)?;
    m.add_function(wrap_pyfunction!(check_test, m)?)
}
