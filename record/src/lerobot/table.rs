//! Tables in Parquet files, written by the crate `parquet` without arrow: columns of numbers, lists of equal length,
//! strings and images, without missing values.

use crate::file::Storage;
use crate::writer::{WriteError, WriteResult};
use parquet::basic::{ConvertedType, Repetition, Type as PhysicalType};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};
use std::io;
use std::sync::Arc;

/// Type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnType {
    /// 64-bit integer.
    Int64,
    /// Boolean.
    Bool,
    /// A double-precision float.
    Float64,
    /// This number of floats; one alone is no list.
    Float32(usize),
    /// A string.
    String,
    /// A list of one string.
    StringList,
    /// An image file and its name.
    Image,
}

/// Values of a column. Lists are concatenated.
#[derive(Debug)]
pub(super) enum Column {
    Int64(Vec<i64>),
    Bool(Vec<bool>),
    Float64(Vec<f64>),
    Float32(Vec<f32>),
    String(Vec<ByteArray>),
    /// Image files, and their names.
    Image(Vec<ByteArray>, Vec<ByteArray>),
}

/// Writer of a table: row groups in sequence.
pub(super) struct TableWriter {
    file: SerializedFileWriter<Box<dyn Storage>>,
    columns: Vec<ColumnType>,
}

impl TableWriter {
    /// Begins a table in a file. `metadata` are key-value pairs for readers.
    pub(super) fn create(
        file: Box<dyn Storage>,
        columns: &[(String, ColumnType)],
        metadata: &[(&str, String)],
    ) -> WriteResult<Self> {
        let fields = columns.iter().map(|(name, kind)| field(name, *kind)).collect::<Result<_, _>>()?;
        let schema = Type::group_type_builder("schema").with_fields(fields).build()?;
        let metadata = metadata.iter().map(|(key, value)| KeyValue::new((*key).to_string(), value.clone())).collect();
        // Statistics and dictionaries would store image files twice.
        let properties = WriterProperties::builder()
            .set_created_by("kinetoscope".into())
            .set_key_value_metadata(Some(metadata))
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::None)
            .build();
        let file = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
        Ok(Self { file, columns: columns.iter().map(|(_, kind)| *kind).collect() })
    }

    /// Writes a row group.
    pub(super) fn write(&mut self, columns: &[Column]) -> WriteResult {
        let mut group = self.file.next_row_group()?;
        for (kind, values) in self.columns.iter().zip(columns) {
            match values {
                Column::Int64(values) => write_values::<Int64Type>(&mut group, values, None)?,
                Column::Bool(values) => write_values::<BoolType>(&mut group, values, None)?,
                Column::Float64(values) => write_values::<DoubleType>(&mut group, values, None)?,
                Column::Float32(values) => write_values::<FloatType>(&mut group, values, kind.list_length())?,
                Column::String(values) => write_values::<ByteArrayType>(&mut group, values, kind.list_length())?,
                Column::Image(files, names) => {
                    write_values::<ByteArrayType>(&mut group, files, None)?;
                    write_values::<ByteArrayType>(&mut group, names, None)?;
                }
            }
        }
        group.close()?;
        Ok(())
    }

    /// Completes the file, and flushes it to the disk.
    pub(super) fn finish(self) -> WriteResult {
        Ok(self.file.into_inner()?.sync()?)
    }
}

impl ColumnType {
    /// Length of the lists; `None` for a column without lists.
    fn list_length(self) -> Option<usize> {
        match self {
            Self::Float32(1) => None,
            Self::Float32(length) => Some(length),
            Self::StringList => Some(1),
            _ => None,
        }
    }
}

/// Writes the values of a physical column; `list_length` is the length of its lists, if it has lists.
fn write_values<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Box<dyn Storage>>,
    values: &[T::T],
    list_length: Option<usize>,
) -> WriteResult {
    let Some(mut column) = group.next_column()? else { return Ok(()) };
    // The first value of a list begins a row, the others repeat it. All values are defined.
    let repetition: Option<Vec<i16>> =
        list_length.map(|length| (0..values.len()).map(|k| i16::from(!k.is_multiple_of(length))).collect());
    let definition = list_length.map(|_| vec![1; values.len()]);
    column.typed::<T>().write_batch(values, definition.as_deref(), repetition.as_deref())?;
    Ok(column.close()?)
}

/// Schema of a column.
fn field(name: &str, kind: ColumnType) -> Result<TypePtr, ParquetError> {
    let value = |name: &str, physical: PhysicalType, converted: ConvertedType| {
        let builder = Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED);
        builder.with_converted_type(converted).build().map(Arc::new)
    };
    let group = |name: &str, repetition: Repetition, converted: ConvertedType, fields: Vec<TypePtr>| {
        let builder = Type::group_type_builder(name).with_repetition(repetition).with_converted_type(converted);
        builder.with_fields(fields).build().map(Arc::new)
    };
    let list = |element: TypePtr| {
        let list = group("list", Repetition::REPEATED, ConvertedType::NONE, vec![element])?;
        group(name, Repetition::REQUIRED, ConvertedType::LIST, vec![list])
    };
    match kind {
        ColumnType::Int64 => value(name, PhysicalType::INT64, ConvertedType::NONE),
        ColumnType::Bool => value(name, PhysicalType::BOOLEAN, ConvertedType::NONE),
        ColumnType::Float64 => value(name, PhysicalType::DOUBLE, ConvertedType::NONE),
        ColumnType::Float32(1) => value(name, PhysicalType::FLOAT, ConvertedType::NONE),
        ColumnType::Float32(_) => list(value("element", PhysicalType::FLOAT, ConvertedType::NONE)?),
        ColumnType::String => value(name, PhysicalType::BYTE_ARRAY, ConvertedType::UTF8),
        ColumnType::StringList => list(value("element", PhysicalType::BYTE_ARRAY, ConvertedType::UTF8)?),
        ColumnType::Image => {
            let bytes = value("bytes", PhysicalType::BYTE_ARRAY, ConvertedType::NONE)?;
            let path = value("path", PhysicalType::BYTE_ARRAY, ConvertedType::UTF8)?;
            group(name, Repetition::REQUIRED, ConvertedType::NONE, vec![bytes, path])
        }
    }
}

impl From<ParquetError> for WriteError {
    /// Errors of the disk keep their kind. All others are limits of the format: nothing else of a table depends on
    /// the recording.
    fn from(error: ParquetError) -> Self {
        match error {
            ParquetError::External(error) => match error.downcast::<io::Error>() {
                Ok(error) => Self::Io(*error),
                Err(error) => Self::limit(error.to_string()),
            },
            error => Self::limit(format!("{error}; use smaller images or shorter episodes")),
        }
    }
}
