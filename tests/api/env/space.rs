//! Spaces of observations and actions.

use kinetoscope::env::{EnvError, Space};
use kinetoscope::ndarray::array;

#[test]
fn bounds_and_names_are_checked() {
    let nan = f64::NAN;
    for bounds in [[1.0, 0.0], [nan, 1.0], [0.0, nan], [f64::INFINITY; 2], [f64::NEG_INFINITY; 2]] {
        let error = Space::uniform(["a"], bounds).expect_err("holds no number");
        assert!(matches!(&error, EnvError::Bounds { column, .. } if column == "a"), "{error}");
    }
    let error = Space::uniform(["a", "b", "a"], [0.0, 1.0]).expect_err("repeated");
    assert!(matches!(&error, EnvError::RepeatedColumn { column } if column == "a"), "{error}");
    // A column that holds one number only is a column.
    assert!(Space::uniform(["a"], [2.0, 2.0]).is_ok_and(|space| space.contains(array![2.0].view())));
}

#[test]
fn rows_are_inside_up_to_their_bounds() {
    let space = Space::new([("a", [-1.0, 1.0]), ("b", [0.0, f64::INFINITY])]).expect("good bounds");
    for (row, inside) in [
        (array![-1.0, 0.0], true),
        (array![1.0, 1e300], true),
        (array![1.1, 1.0], false),
        (array![0.0, -1e-300], false),
        (array![f64::NAN, 1.0], false),
        (array![0.0], false),
    ] {
        assert_eq!(space.contains(row.view()), inside, "{row}");
    }
    assert_eq!(space.column("b").ok(), Some(1));
    let Err(EnvError::UnknownName { candidates, .. }) = space.column("c") else { panic!("there is no column c") };
    assert_eq!(candidates, ["a", "b"]);
}
