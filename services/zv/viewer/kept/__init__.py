"""Events of a day with their pictures: kept in a file, found again by HTTP."""
