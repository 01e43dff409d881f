"""Pictures of the book that a reader can move, and the still ones that paper and a page without script show.

:mod:`~gpbnb.report.pictures.picture` says what a picture consists of, and :mod:`~gpbnb.report.pictures.views`
defines each. A picture uses the form and the script of the calculators. A JavaScript file of the same name computes its
numbers and draws its lines; the data come from the package.
"""
