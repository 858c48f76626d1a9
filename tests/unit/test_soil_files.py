# SPDX-License-Identifier: MIT
"""Curves from CSV files."""

import pytest

from fenics_hytf.soil import CurveFileError, read_curve_file


def read(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "clay.csv"
    path.write_text(text, encoding=encoding)
    return read_curve_file(path)


@pytest.mark.parametrize(
    "text",
    [
        "strain,modulus,damping\n1e-6,1,0.01\n1e-3,0.5,0.125\n",
        "strain_percent,modulus,damping_percent\n1e-4,1,1\n0.1,0.5,12.5\n",
        "# a laboratory\n\nDamping_Percent ; Strain ; Modulus\n1; 1e-6; 1\n# more\n12.5; 1e-3; .5",
        "\ufeffmodulus,strain_percent,damping\r\n1.0,1e-4,0.01\r\n0.5,0.1,0.125\r\n",
    ],
)
def test_columns_by_their_names(tmp_path, text):
    columns = read(tmp_path, text)
    assert list(columns) == ["strain", "modulus", "damping"]
    assert columns["strain"] == pytest.approx([1e-6, 1e-3], rel=1e-15)
    assert columns["modulus"] == [1.0, 0.5]
    assert columns["damping"] == pytest.approx([0.01, 0.125], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "clay.csv, line 1: found ''; expected the column names strain or strain_percent,"),
        ("1e-6,1,0.01\n", "clay.csv, line 1: found '1e-6', '1', '0.01'; expected the column names"),
        ("strain,modulus\n", "line 1: found 'strain', 'modulus'; expected"),
        ("strain,modulus,damping,depth\n", "line 1: found 'strain', 'modulus', 'damping', 'dep"),
        ("strain,strain_percent,damping\n", "line 1: found 'strain', 'strain_percent', 'damp"),
        ("# x\nstrain,modulus,d\n", "clay.csv, line 2: found 'strain', 'modulus', 'd'"),
        ("strain,modulus,damping\n1e-6,1\n", "clay.csv, line 2: found 2 columns; expected 3"),
        ("strain,modulus,damping\n1e-6,x,0\n", "line 2: found 'x'; expected a finite number in"),
        ("strain,modulus,damping\n1e-6,1,nan\n", "found 'nan'; .* in the column damping"),
        ("strain;modulus;damping\n0,0001;1,0;0,8\n", "line 2: found 6 columns; expected 3"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, text, problem):
    with pytest.raises(CurveFileError, match=problem):
        read(tmp_path, text)


def test_every_line_is_told(tmp_path):
    with pytest.raises(CurveFileError) as error:
        read(tmp_path, "strain,modulus,damping\n1e-6,x,inf\n1e-5\n1e-4,1,y\n")
    assert [p.split(";")[0] for p in error.value.problems] == [
        "clay.csv, line 2: found 'x'",
        "clay.csv, line 2: found 'inf'",
        "clay.csv, line 3: found 1 columns",
        "clay.csv, line 4: found 'y'",
    ]


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(CurveFileError, match=r"none.csv: found No such file .*; expected a read"):
        read_curve_file(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    with pytest.raises(CurveFileError, match="expected the column names"):
        read_curve_file(tmp_path / "binary.csv")
